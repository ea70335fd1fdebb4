"""Panels beside the views, and dialogs: each shows one thing of a `Workspace`, and passes on clicks."""
