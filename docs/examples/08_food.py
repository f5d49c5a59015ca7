"""A food of one's own from one that is there: other values, written and read back."""

from calib.material.food_file import dump_material
from cutcal import Food

potato = Food.load("potato")
print("fitted by default:", ", ".join(potato.default_fit))
for text in potato.warnings()[:3]:
    print("note:", text)

boiled = potato.with_values({"E": 1.5e5, "R": 40.0}, status="given", source="our own boiled potatoes")
dump_material(boiled, "boiled.yaml", {"made by": "docs/examples/08_food.py"})
again = Food.load("boiled.yaml")
print(f"E = {again.value('E'):g} Pa ({again.properties['E'].source}), prior {again.prior('E')}")

scene_food = again.to_scene_food(height=0.03)
print(f"P-wave speed {scene_food.material.p_wave:.1f} m/s in a {scene_food.shape.kind}")
