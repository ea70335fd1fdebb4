"""Qt widgets: they show what `Session` holds and pass on what a person does; no numbers are computed here."""
