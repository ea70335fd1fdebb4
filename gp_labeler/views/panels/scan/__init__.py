"""The panel of the step Scan: its cards and its dialogs."""
