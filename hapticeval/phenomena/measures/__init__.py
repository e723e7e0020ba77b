"""What several checks measure of a recording, a concept a module."""
