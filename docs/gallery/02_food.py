"""What the literature says of a food: the range of each property over its value."""

from cutcal import Food

axes = Food.load("cucumber").plot()
axes.figure.savefig("food.png")
