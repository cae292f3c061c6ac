"""What a person saw in the pictures, by the commit of the program that made them: one honest line a clip."""

SEEN: dict[str, dict[str, str]] = {
    "5a502570": {
        "person_walk_away_1": "default and click: man whole and sharp",
        "people_two_talk_street_1": "default and click: both whole and sharp before an estimated street",
        "person_ball_portrait_1": "default and click: man and ball whole and sharp; the plant stays sharp",
        "people_two_portrait_1": "default and click: both whole and sharp; one of her hands soft by default",
        "person_run_indoor_1": "default and click: whole and sharp",
        "person_dance_davis_1": "default and click: whole; bits of the crowd at her arms, one hand soft",
        "person_door_dark_1": "default and click: whole and sharp",
        "person_run_towards_1": "default and click: whole and sharp before a soft lake, hair included",
        "person_selfie_hevc_rot_1": "default and click: face, hair and headphones sharp; shoulders soft",
        "person_tennis_vfr_1": "default and click: body whole; the racket is lost, a hand and ball soft",
        "person_road_cup_portrait_1": "default and click: woman and both cups sharp",
        "backpack": "default and click: man and bag whole and sharp",
        "night_walker": "default and click: whole and sharp but for the bag; patches of the wet street stay "
        "sharp",
        "paraglider": "default and click: man whole and sharp, his lines are lost",
        "robot": "default and click: whole; hands and a foot soft, pieces of the shelf beside it",
        "animal_cow_davis_1": "default: whole, hardly any blur; click: the muzzle is lost",
        "animal_goat_davis_1": "click: whole and sharp, a rock with it; default: belly and legs blurred",
        "animal_kitten_1": "default and click: face, back and forelegs sharp; tail and a paw blurred",
        "cat": "default and click: right",
        "dog": "default and click: whole; muzzle and chest a little soft, as filmed",
        "vehicle_car_roundabout_davis_1": "click: whole; a dark piece of another car. Default: whole",
        "vehicle_scooter_davis_1": "default and click: the helmet blurred, the rest sharp",
        "still_garden_shaky_1": "default: the path in front; click: the place; right",
        "still_roof_hlg10_rot_1": "click: two of three frames by one coarse mesh, a wall is blurred away: an "
        "aperture that the program no longer takes",
        "night_hall_lights_1": "discs grow to the right, where depth is a guess",
        "plant_on_desk": "default: right; click: crown and trunk sharp, one side of the pot blurred",
        "duck": "default: the mannequin, taken for a person; click: right",
        "room": "default and click: the sofa; right",
    },
}
