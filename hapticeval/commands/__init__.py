"""The commands, a module each: shells around what the rooms below do."""

import os

# Jobs run side by side, a process a core: threads of linear algebra in each would wait for each other. numpy reads it
# when it is loaded, which the modules of this room do.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
