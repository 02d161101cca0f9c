"""An arm touches, slides, lifts and explores by what a tactile sensor measures: the `step` of a skill makes a twist, in
contact by `ContactServo.pressed`, `Controller.step` limits it, and the node `contact_controller` publishes it."""
