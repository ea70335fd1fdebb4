"""The panel of the step Atlas: its cards and its dialogs."""
