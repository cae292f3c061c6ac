"""What a person saw in the pictures, by the commit of the program that made them: one honest line a clip."""

SEEN: dict[str, dict[str, str]] = {
    "691bf4a": {
        "person_walk_away_1": "click refused",
        "person_ball_portrait_1": "click: man and ball whole and sharp; nothing picked: the wall",
        "person_run_indoor_1": "click: whole and sharp; nothing picked: all blurred away",
        "person_dance_davis_1": "click: superb there, blurred in four of six frames; nothing picked: blurred",
        "backpack": "click: the man is sharp, half of the bag's outline is not; nothing picked: his shoes",
        "night_walker": "click refused",
        "paraglider": "click: man whole, his lines are lost in grass; nothing picked: the same",
        "robot": "click: whole and sharp; nothing picked: the wall behind it",
        "animal_cow_davis_1": "click refused",
        "animal_kitten_1": "click: face sharp, body and cushion blurred alike; nothing picked: the tail",
        "cat": "click: face sharp, body as of a very fast lens; nothing picked: body",
        "dog": "click: whole and sharp; nothing picked: blurred away",
        "vehicle_car_roundabout_davis_1": "click: whole and sharp, a smear beside its bonnet",
        "vehicle_scooter_davis_1": "click: whole and sharp, specks of sharp foliage behind it",
        "still_garden_shaky_1": "as a lens; a pale arc in the sky beside the lamp post",
        "still_roof_hlg10_rot_1": "small blur, right",
        "night_hall_lights_1": "discs grow with distance; as small as in the sheet no fault is seen",
        "plant_on_desk": "click refused; nothing picked: small blur, right",
        "duck": "right",
        "room": "click: sofa sharp, door frame before it blurred, right; nothing picked: refused",
    },
}
"""Short commit -> clip -> what is seen. A line is shown beside pictures of that commit alone."""
