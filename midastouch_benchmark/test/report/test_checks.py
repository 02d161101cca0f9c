from midastouch_benchmark.report.results_page import write_results_page


def test_every_table_is_on_the_page(tmp_path):
    case = {"alarms": 0.25, "named_turned": 0.67, "quietest_tenth": 1.5, "explained_share": 0.75}
    case |= {"auc_quietest_tenth": 0.5, "auc_explained_share": None}
    touches = [{"from_mm": 0.05, "to_mm": 0.1, "touches": 7, "missed": 0.14}]
    result = {
        "network": "tdn_x-1",
        "sensor": "digit_tacto",
        "sensors": 40,
        "no_contact_images": 24,
        "fit_check": {"right": case},
        "no_contact_image": {"upside down": 1.0},
        "cause_named": {"upside down": 0.83},
        "real_sensors": {"d20641": {"trials": 62, "right": 0.02, "touched": 0.97}},
        "ball_diameter": {"given": [{"factor": 1.4, "doubted": 0.46}]},
        "capture": {"a touch refused": 0.98},
        "contact": {
            "missed": {"wire": touches},
            "false": [{"brighter": 0.02, "false_contacts": 0.03}],
            "false_while_warming": 0.011,
        },
    }
    content = write_results_page([("checks.json", result)], tmp_path).read_text()
    for text in (
        "tdn_x-1",
        "0.25",
        "upside down",
        "0.98",
        "0.83",
        "0.67",
        "wire, 0.05 to 0.10 mm deep",
        "0.14",
        "2 % brighter",
        "d20641",
        "0.97",
        "0.46",
        "0.03",
        "0.01",
    ):
        assert text in content
