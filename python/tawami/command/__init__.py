"""The command `tawami`; its entry point is `tawami.command.main.run`."""
