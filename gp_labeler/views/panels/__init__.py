"""Panels beside the views, and dialogs: each shows one thing of a `Workbench`, and passes on clicks."""
