"""The recordings: EMPS where it lies beside the project, and simulated axes."""

from axis import ROOT, Case, Parameters, bristle

# Name, motion, J, Fc, Fv, counts a turn or a metre, and how it is driven.
SIMULATED = [
    ("rotary, open loop", "rotary", Parameters(0.01, 0.2, 0.02), 4096, ["--amplitude", 1.2, "--band", "0.2:5"]),
    ("rotary, closed loop", "rotary", Parameters(0.01, 0.2, 0.02), 4096,
     ["--amplitude", 2.0, "--band", "0.2:3", "--control", "pd"]),
    ("linear, closed loop", "linear", Parameters(60.0, 25.0, 150.0), 20000,
     ["--amplitude", 0.15, "--band", "0.1:2", "--control", "pd"]),
]  # fmt: skip
# Unrecorded torque, as a share of the RMS of the drive.
NOISE = 0.02


def emps():
    for folder in ROOT.resolve().parents:
        path = folder / "shared/data/emps/emps_est.csv"
        if path.is_file():
            # Published by A. Janot, M. Gautier, M. Brunot, 2019, for the model with an offset.
            published = Parameters(95.1089, 20.3935, 203.5034, -3.1648)
            case = lambda name, offset: Case(name, path, "linear", "voltage", 35.15065188, published, offset)
            return [case("EMPS", False), case("EMPS with the offset of its published model", True)]
    print("skipped: ../shared/data/emps/emps_est.csv is not there")
    return []


def simulated(folder):
    for name, motion, truth, counts, drive in SIMULATED:
        stem = name.replace(", ", "-").replace(" ", "-")
        kind = "torque" if motion == "rotary" else "force"
        case = Case(name, folder / f"{stem}.csv", motion, kind, 1.0, truth)
        model = folder / f"{stem}.toml"
        model.write_text(case.model(truth))
        record = lambda noise: bristle(
            "simulate", "--model", model, "--excite", "multisine", "--duration", 30, "--seed", 7,
            "--counts", counts, "--noise", noise, "--out", case.path, *drive,
        )  # fmt: skip
        record(0.0)
        u = case.load()[1]
        record(NOISE * (u @ u / len(u)) ** 0.5)
        yield case


def cases(folder):
    return emps() + list(simulated(folder))
