"""Long work off the user interface's thread: the runner, and the frozen jobs it runs."""
