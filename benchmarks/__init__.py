"""Studies that print tables and draw charts; each module is a command."""
