"""An arm touches, slides, lifts and explores by what a tactile sensor measures.

A twist is made by the `step` of a skill (`control/skills.py`), in contact by `ContactServo.pressed`; `Controller.step`
limits and guards it, and the node `contact_controller` publishes it.
"""
