"""Function approximators: tables, tiles, radial basis functions, Kanerva coding, networks (section 4.2.6)."""
