"""The five steps and the dialogs between them, a file each."""
