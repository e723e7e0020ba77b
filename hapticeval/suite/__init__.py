"""Suites: files of cases, each a scene, a stimulus and the checks that judge it."""
