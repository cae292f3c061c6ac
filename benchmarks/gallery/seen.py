"""What a person saw in the pictures, by the commit of the program that made them: one honest line a clip."""

SEEN: dict[str, dict[str, str]] = {
    "a412fd5": {
        "person_walk_away_1": "default and click: man whole and sharp",
        "people_two_talk_street_1": "default and click: both whole and sharp before an estimated "
        "street; sharp rims of 10 px at her mouth and hand",
        "person_ball_portrait_1": "default and click: man and ball whole; the ground at his feet is "
        "blurred more than it should be",
        "people_two_portrait_1": "default and click: both sharp; a strip beside his arm stays sharp",
        "person_run_indoor_1": "default and click: whole and sharp; a torn piece of another head beside hers",
        "person_dance_davis_1": "default and click: whole, but for a raised hand in one of four frames; "
        "bits of the crowd at her outline",
        "person_door_dark_1": "default and click: whole and sharp",
        "backpack": "default and click: man and bag whole and sharp",
        "night_walker": "default and click: whole and sharp, boots and hair included; her bag is not; "
        "specks of the street stay sharp, mended since",
        "paraglider": "default and click: man whole, his lines are lost",
        "robot": "body sharp; feet and head are not, and the wall beside it is",
        "animal_cow_davis_1": "muzzle and a foreleg blurred, ground between the legs sharp",
        "animal_kitten_1": "default and click: face, body and one foreleg sharp; hind leg and an ear in part",
        "cat": "default and click: right",
        "dog": "default and click: whole; muzzle and chest a little soft, as filmed",
        "vehicle_car_roundabout_davis_1": "default and click: whole and sharp",
        "vehicle_scooter_davis_1": "rider's head blurred in two of four frames, the rest sharp",
        "still_garden_shaky_1": "default: the path in front; click: the place; right",
        "still_roof_hlg10_rot_1": "small blur, right",
        "night_hall_lights_1": "discs grow with distance",
        "plant_on_desk": "small blur, right",
        "duck": "default: the mannequin, taken for a person; click: right",
        "room": "default: the door frame at the right; click: the sofa",
    },
    "7118aa6": {
        "person_walk_away_1": "default and click: man whole and sharp in all eight frames",
        "people_two_talk_street_1": "default and click: both whole and sharp before an estimated "
        "street; sharp rims of 10 px at her mouth and hand",
        "person_ball_portrait_1": "man and ball whole; the ground at his feet is blurred more "
        "than it should be",
        "people_two_portrait_1": "both sharp; a tripod leg beside her mouth stays sharp",
        "person_run_indoor_1": "whole and sharp; a torn piece of another head beside hers",
        "person_dance_davis_1": "whole but for a raised forearm in two of eight frames; bits "
        "of the crowd at her outline",
        "person_door_dark_1": "whole and sharp",
        "backpack": "man and bag whole and sharp",
        "night_walker": "whole and sharp, boots and hair included; her bag is not",
        "paraglider": "man whole, his lines are lost",
        "robot": "body sharp; black feet and hands are not",
        "animal_cow_davis_1": "muzzle and a foreleg blurred, ground between the legs sharp",
        "animal_kitten_1": "click: face and back sharp, white flank and forelegs not; "
        "nothing picked: the tail",
        "cat": "right",
        "dog": "whole; muzzle and chest a little soft, as filmed",
        "vehicle_car_roundabout_davis_1": "click: whole and sharp; nothing picked: the pedestal behind it",
        "vehicle_scooter_davis_1": "rider's helmet blurred, the rest sharp",
        "still_garden_shaky_1": "click: right; nothing picked: an error, mended since",
        "still_roof_hlg10_rot_1": "small blur, right",
        "night_hall_lights_1": "discs grow with distance",
        "plant_on_desk": "small blur, right",
        "duck": "right",
        "room": "click: sofa sharp, door frame before it blurred; nothing picked: an error, mended since",
    },
}
"""Short commit -> clip -> what is seen. A line is shown beside pictures of that commit alone."""
