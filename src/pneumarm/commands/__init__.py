"""One file a command: it parses, calls the library, shows the result. No logic lives here."""
