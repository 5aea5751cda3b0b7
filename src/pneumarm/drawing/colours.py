"""The colours of figures, here by themselves: what is no figure needs no library that draws.

The inks differ in lightness as well as in hue, so that they are told apart in grey and by the colour-blind.
"""

INK = "#1a1a1a"
DARK = "#12476b"
"""Blue, about 30% light: what the figure is about."""
MIDDLE = "#d1602b"
"""Orange, about 53% light: what it is compared with."""
LIGHT = "#dcb24c"
"""Sand, about 75% light: a third thing, or areas."""
GREY = "#8a8a8a"
PALE = "#d9d9d9"
