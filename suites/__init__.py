"""The suites that are installed: TOML files of cases, a file a theme."""
