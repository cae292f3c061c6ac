"""What a person saw in the pictures, by the commit of the program that made them: one honest line a clip."""

SEEN: dict[str, dict[str, str]] = {
    "cd0b7254": {
        "person_walk_away_1": "default and click: man whole and sharp",
        "people_two_talk_street_1": "default and click: both whole and sharp before an estimated street; "
        "a faint rim at his headband",
        "person_ball_portrait_1": "click: man and ball whole; the plant beside him stays sharp. Default: "
        "nothing is blurred, mended since",
        "people_two_portrait_1": "default and click: both sharp; a strip beside his arm stays sharp",
        "person_run_indoor_1": "default and click: whole and sharp; the logo stays with a bit of background",
        "person_dance_davis_1": "default and click: whole; bits of the crowd at both arms and her head",
        "person_door_dark_1": "default and click: whole and sharp",
        "person_run_towards_1": "default and click: whole and sharp before a soft lake, hair included",
        "person_selfie_hevc_rot_1": "face, hair and headphones sharp; one shoulder blurred, a lock torn off",
        "person_tennis_vfr_1": "body sharp; both hands, the racket and the ball are lost",
        "person_road_cup_portrait_1": "default and click: woman and both cups sharp",
        "backpack": "default and click: man and bag whole and sharp",
        "night_walker": "default and click: whole and sharp; patches of the wet street stay sharp",
        "paraglider": "default and click: man whole, his lines are lost",
        "robot": "white parts sharp; hands and feet blurred in part, a piece of the shelf sharp",
        "animal_cow_davis_1": "muzzle lost, specks of ground between the legs sharp",
        "animal_goat_davis_1": "back and head sharp; belly, legs and tail blurred away",
        "animal_kitten_1": "face, forelegs and a part of the back sharp; a rim of the cushion beside them",
        "cat": "default and click: right",
        "dog": "default and click: whole; muzzle and chest a little soft, as filmed",
        "vehicle_car_roundabout_davis_1": "click: whole and sharp; a dark piece of another car. Default: the "
        "car soft in fog, mended since",
        "vehicle_scooter_davis_1": "click: the helmet blurred, the rest sharp. Default: hardly any blur",
        "still_garden_shaky_1": "default: the path in front; click: the place; right",
        "still_roof_hlg10_rot_1": "small blur; wavy edges of pipes in front",
        "night_hall_lights_1": "discs grow to the right, where depth is a guess; bursts of rays",
        "plant_on_desk": "default: right; click: crown and trunk sharp, one side of the pot blurred",
        "duck": "default: the mannequin, taken for a person; click: right",
        "room": "default and click: the sofa; right",
    },
}
