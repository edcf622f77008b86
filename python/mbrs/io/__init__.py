"""Readers and writers of other programs' files, one format in a module. `mbrs.formats` finds them by the endings they register."""
