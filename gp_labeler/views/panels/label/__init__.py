"""The panel of the step Label: its cards and its dialogs."""
