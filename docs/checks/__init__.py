"""The page of each check, in Markdown: `hapticeval explain` and the report read them."""
