"""The calibration of a machine on the page: the command's results, faults at their rows, limits."""

from __future__ import annotations

import csv
import io
import json
import re
import subprocess
import sys
import tomllib

import openpyxl
import pytest

from tests.support.calibration_bay import CAMBER, TOE, Bay, changed, item_of, machine
from tests.support.certificates import CERTIFICATE_TOML, SETTINGS_TOML
from tests.support.made import write_small_capture
from tests.support.web_site import PAPER, Site
from wheelplane.calibration import COLUMNS, ItemFile, item_toml, load_item
from wheelplane.calibration.calibrate import calibrate
from wheelplane.config import parse_section
from wheelplane.errors import ConfigError, InputError
from wheelplane.report.format.language import load_translations
from wheelplane.web.content.calibrating import choices, evaluate, references_of
from wheelplane.web.content.calibration_files import Request, calibration_files
from wheelplane.web.content.faults import in_words, item_in_words
from wheelplane_synth.machine.forms import readings_csv
from wheelplane_synth.machine.indicate import indicate

NUMBER = re.compile(r"-?\d+(\.\d+)?")
TESTED = machine(toe=TOE, camber=CAMBER)
ITEM = item_toml(item_of(TESTED))


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    place = tmp_path_factory.mktemp("site")
    (place / "settings.toml").write_text(SETTINGS_TOML)
    made = Site(place, config=place / "settings.toml")
    write_small_capture(made.allowed / "capture", trials=4)
    made.copy(PAPER, "figure-4.txt")
    yield made
    made.close()


@pytest.fixture(scope="module")
def job(site):
    state = site.measure({"root": 0, "path": "capture"})
    assert state["state"] == "done", state
    return state["id"]


@pytest.fixture(scope="module")
def table(site):
    import numpy as np

    truth = json.loads((site.allowed / "capture" / "truth.json").read_text())
    return readings_csv(indicate(truth, TESTED, np.random.default_rng(0)))


@pytest.fixture(scope="module")
def rows(table):
    return [[row.get(name, "") for name in COLUMNS] for row in csv.DictReader(io.StringIO(table))]


def entered(site, job, rows, item=ITEM, **more):
    answer = site.post(f"/api/jobs/{job}/calibration", {"item": item, "readings": rows, **more})
    assert answer.status_code == 200, answer.json
    return answer.json


def saved(site, job, rows, name, **more):
    given = {"item": ITEM, "readings": rows, "root": 0, "name": name, **more}
    return site.post(f"/api/jobs/{job}/calibration/save", given)


def by_command(site, *arguments):
    command = [sys.executable, "-m", "wheelplane", "calibrate", "capture", *arguments]
    settings = ("--config", str(site.allowed.parent / "settings.toml"))
    return subprocess.run([*command, *settings], cwd=site.allowed, capture_output=True, check=False)


# The same results as the command's


@pytest.mark.slow
def test_what_is_saved_is_what_the_command_finds_in_the_same_files(site, job, rows):
    answer = saved(site, job, rows, "first", certificate=CERTIFICATE_TOML)
    assert answer.status_code == 200, answer.json
    folder = site.allowed / "first"
    assert answer.json["saved"] == str(folder)
    files = ("--item", "first/item.toml", "--readings", "first/readings.csv")
    found = by_command(site, *files, "--json")
    assert found.returncode == 0, found.stderr
    assert (folder / "calibration.json").read_bytes() == found.stdout
    again = (*files, "--certificate", "first/certificate.toml", "-o", "again")
    assert by_command(site, *again).returncode == 0
    for name in ("calibration.json", "calibration.txt", "certificate.html"):
        assert (folder / name).read_bytes() == (site.allowed / "again" / name).read_bytes(), name


def test_what_is_shown_is_what_is_saved(site, job, rows):
    shown = entered(site, job, rows)
    assert shown["faults"] == []
    saved(site, job, rows, "shown")
    tree = json.loads((site.allowed / "shown" / "calibration.json").read_text())
    points = [(q["quantity"], p) for q in tree["quantities"] for p in q["points"]]
    assert [(p["quantity"], p["point"]) for p in shown["points"]] == [
        (kind, point["point"]) for kind, point in points
    ]
    for one, (_, point) in zip(shown["points"], points, strict=True):
        assert one["decision"]["kind"] == point["decision"].replace(" ", "-")
        expanded_s = float(one["expanded"].rstrip('"'))
        assert expanded_s == pytest.approx(3600.0 * point["error"]["expanded_95_deg"], rel=0.06)
        error_s = 3600.0 * point["error"]["value_deg"]
        assert abs(float(one["error"].rstrip('"')) - error_s) <= 0.051 * expanded_s
    assert shown["decision"]["kind"] == tree["decision"].replace(" ", "-")


@pytest.mark.parametrize("kind", ["csv", "xlsx"])
def test_a_table_becomes_rows_of_the_page(site, job, table, rows, kind):
    content = table.encode()
    if kind == "xlsx":
        book, stream = openpyxl.Workbook(), io.BytesIO()
        for row in csv.reader(io.StringIO(table)):
            book.active.append(
                [float(c) if c.lstrip("-").replace(".", "").isdigit() else c for c in row]
            )
        book.save(stream)
        content = stream.getvalue()
    found = site.put(f"/api/jobs/{job}/readings/My readings.{kind}", content)
    assert found.status_code == 200, found.json
    assert found.json["rows"] == rows
    folder = site.app.config["state"].jobs.found(job).folder
    assert [*folder.glob("table-*"), *folder.glob("rows-*")] == []  # nothing is left of it


def test_the_faults_of_a_table_name_it(site, job):
    found = site.put(f"/api/jobs/{job}/readings/mine.csv", b"point,quantity,sum\n1,toe,3\n")
    assert found.status_code == 400
    assert "mine.csv: row 1, column sum: unknown column" in found.json["error"]
    assert str(site.allowed.parent) not in found.json["error"]


def test_a_table_whose_rows_the_page_cannot_hold_is_refused_as_by_the_command(site, job, table):
    lines = table.splitlines()
    twice = "\n".join([*lines, lines[5]])
    found = site.put(f"/api/jobs/{job}/readings/r.csv", twice.encode())
    assert found.status_code == 400
    (site.allowed / "r.csv").write_text(twice)
    (site.allowed / "item.toml").write_text(ITEM)
    printed = by_command(site, "--item", "item.toml", "--readings", "r.csv").stderr.decode()
    assert found.json["error"].startswith(f"r.csv: row {len(lines) + 1}, column repeat: ")
    assert found.json["error"] in printed
    units = "\n".join([*lines[:3], lines[3].replace(",min,", ",deg,"), *lines[4:]])
    found = site.put(f"/api/jobs/{job}/readings/r.csv", units.encode())
    assert found.status_code == 400
    assert found.json["error"].startswith("r.csv: row 4, column unit: 'deg', but toe is in 'min'")
    site.client.set_cookie("wheelplane-language", "pt", domain="127.0.0.1")
    found = site.put(f"/api/jobs/{job}/readings/r.csv", units.encode()).json["error"]
    site.client.delete_cookie("wheelplane-language", domain="127.0.0.1")
    assert "linha 4, coluna unit: 'deg', mas " in found


# Growing


def test_errors_grow_with_the_readings(site, job, rows):
    of_toe = [row for row in rows if row[1] == "toe"]
    assert entered(site, job, [])["points"] == []
    one = entered(site, job, of_toe[:1])
    assert one["points"] == []
    assert "no reading is repeated" in one["faults"][0]["text"]
    names = lambda found: [point["point"] for point in found["points"]]  # noqa: E731
    six = entered(site, job, of_toe[:6])  # three up, three down
    assert (names(six), six["faults"]) == (["RR"], [])
    seven = entered(site, job, of_toe[:7])  # the second point, so far upwards only
    assert names(seven) == ["RR"]
    assert "point RL has no reading in series 1, down" in seven["faults"][0]["text"]
    assert seven["faults"][0]["row"] is None
    assert names(entered(site, job, of_toe[:12])) == ["RR", "RL"]


def test_a_fault_stands_at_its_row_and_the_others_are_evaluated(site, job, rows):
    wrong = [list(row) for row in rows]
    value, unit, point = (COLUMNS.index(name) for name in ("value", "unit", "point"))
    wrong[2][value] = "-"
    wrong[7][unit] = "gon"
    wrong[13][point] = "99"
    wrong.append(list(rows[20]))  # twice
    found = entered(site, job, wrong)
    assert [(fault["row"], fault["column"]) for fault in found["faults"]] == [
        (2, "value"), (7, "unit"), (13, "point"), (len(rows), "repeat"),
    ]  # fmt: skip
    assert found["faults"][0]["text"].startswith("'-' is no number: write it as -0.25")
    whole = entered(site, job, rows)
    assert len(found["points"]) == len(whole["points"])
    assert found["points"][-1] == whole["points"][-1]  # of a quantity without a fault
    refused = saved(site, job, wrong, "wrong")
    assert refused.status_code == 400
    assert "readings.csv: row 4, column value: '-' is no number" in refused.json["error"]
    assert not (site.allowed / "wrong").exists()


def test_each_series_may_have_a_reference_of_its_own(site, job, rows):
    other = site.measure({"root": 0, "path": "capture"})["id"]
    series = COLUMNS.index("series")
    again = [[*row[:series], "2", *row[series + 1 :]] for row in rows]
    found = entered(site, job, [*rows, *again], references=[other])
    assert found["faults"] == []
    assert len(found["points"]) == len(entered(site, job, rows)["points"])
    third = [[*row[:series], "3", *row[series + 1 :]] for row in rows]
    faults = entered(site, job, third, references=[other])["faults"]
    assert "series '3' has no reference: those given are of series 1, 2" in faults[0]["text"]
    answer = saved(site, job, [*rows, *again], "two", references=[other])
    assert answer.status_code == 200, answer.json
    tree = json.loads((site.allowed / "two" / "calibration.json").read_text())
    assert [one["series"] for one in tree["references"]] == ["1", "2"]
    given = {"item": ITEM, "readings": rows, "references": "x"}
    assert site.post(f"/api/jobs/{job}/calibration", given).status_code == 400
    assert (
        site.post(f"/api/jobs/{job}/calibration", given | {"references": ["gone"]}).status_code
        == 404
    )


def test_the_portuguese_page_says_faults_in_portuguese(site, job, rows):
    wrong = [list(row) for row in rows]
    value, unit, repeat = (COLUMNS.index(name) for name in ("value", "unit", "repeat"))
    wrong[2][value], wrong[7][unit], wrong[9][repeat] = "1,234", "gon", "0"
    words, folder = load_translations("pt"), site.app.config["state"].jobs.shown(job).folder
    given = Request(tomllib.loads(ITEM), tuple(map(tuple, wrong)))
    found = evaluate([folder], given, "pt")["faults"]
    texts = [fault["text"] for fault in found]
    assert texts[:3] == [
        "'1,234' tanto pode ser 1.234 como 1234: escrevê-lo com um ponto",
        "'gon' não é unidade de convergência: conhecem-se deg, dms, min, mm/m, mm",
        "'0': é preciso um número inteiro a partir de 1",
    ]
    assert not any(" no " in f" {text} " and "reading" in text for text in texts)
    with pytest.raises(InputError) as error:
        calibration_files(references_of([folder]), given, None, "pt")
    assert "readings.csv: linha 4, coluna value: '1,234' tanto pode" in str(error.value)
    assert words("fault.row", row=4) == "linha 4"


@pytest.mark.parametrize(
    "declared",
    [{"declared_positive": "toe-out"}, {"axis": "thrust-line", "declared_axis": "rear-axle"}],
)
def test_the_portuguese_page_says_that_readings_fit_another_convention(declared):
    tested = machine(toe=changed(TOE, **declared))
    seen = [calibrate([bay.reference()], item_of(tested), bay.readings(tested)).warnings
            for bay in (Bay(seed=seed) for seed in range(4))]  # fmt: skip
    (text, *_) = (text for found in seen for text in found)
    assert in_words(text, load_translations("en")) == text
    said = in_words(text, load_translations("pt"))
    assert said.startswith("convergência, como recebido: as leituras ajustam-se muito melhor")
    assert set(text.parts["convention"].parts.values()) <= set(said.split('"'))
    assert text.parts["found"].replace(".", ",") in said


def test_the_portuguese_page_says_in_portuguese_what_an_item_lacks(site, job):
    folder = site.app.config["state"].jobs.shown(job).folder
    cases = [
        (("toe", "axis"), "convergência: não tem eixo: "),
        (("toe", "positive"), "convergência: não tem convenção de sinal: "),
        (("camber", "definition"), "sopé: não tem definição: "),
        (("maker", None), "maker: está vazio: "),
        (("toe", "resolution"), "toe.resolution: falta: "),
    ]
    for (table, key), start in cases:
        tree = tomllib.loads(ITEM)
        if key is None:
            tree["item"][table] = ""
        else:
            del tree["item"][table][key]
        found = evaluate([folder], Request(tree, ()), "pt")["item_faults"]
        assert [one for one in found if one.startswith(start)], found
    tree = tomllib.loads(ITEM)
    del tree["decision"]
    (one,) = evaluate([folder], Request(tree, ()), "pt")["item_faults"]
    assert one.startswith("convergência: tem um EMA, mas não foi escolhida uma regra")


TURNS = {"resolution": "1'", "positive": "toe-out"}


@pytest.mark.parametrize(
    ("path", "value", "text"),
    [
        ("item.toe.resolution", "x", "toe.resolution: 'x' não é um valor com a sua unidade: "),
        ("item.toe.resolution", "0°70'", 'toe.resolution: "0°70\'": escrever graus e minutos'),
        ("item.toe.resolution", "-1'", "toe.resolution: -1': escrevê-lo como um valor superior"),
        ("item.toe.mpe", "2 mm", "toe.mpe: 2 mm é medido na jante: indicar o diâmetro desta"),
        ("item.rim", "16", "rim: '16' não é um diâmetro de 0.1 a 2 m: "),
        ("item.toe.axis", "x", "toe.axis: 'x': escrever um de 'rear-axle', 'centreline', "),
        ("item.toe.positive", "x", "convergência: o sentido positivo é 'x': escrever um de "),
        ("item.toe.definition", "iso", "convergência: a definição é só do sopé: "),
        ("item.toe.inner_deg", 20.0, "convergência: o ângulo interior é só da divergência "),
        ("item.camber.axis", "rear-axle", "sopé: não depende de nenhum eixo: "),
        ("item.track", {"resolution": "1'"}, "track.resolution: é um ângulo, mas é preciso um "),
        ("item.track", {"resolution": "1 mm", "positive": "toe-in"}, "via: é um comprimento: "),
        ("item.toe_out_on_turns", TURNS, "divergência em curva: falta o ângulo da roda interior"),
        ("item.toe_out_on_turns", TURNS | {"inner_deg": 70.0}, "toe_out_on_turns.inner_deg: 70.0"),
        (
            "item.toe_out_on_turns",
            TURNS | {"inner_deg": "x"},
            "toe_out_on_turns.inner_deg: 'x': é ",
        ),
        ("item.foo", "x", "foo: chave desconhecida: conhecem-se maker, "),
        ("item.maker", 3, "maker: 3: é preciso um texto entre aspas"),
        ("item.toe", "x", "toe: 'x': é precisa uma tabela"),
        ("decision.rule", "x", "decision.rule: 'x': escrever um de 'guarded', 'simple', 'shared'"),
        ("decision.confidence", 2.0, "decision.confidence: 2.0: escrever menos de 1"),
        ("decision.confidence", 0.1, "decision.confidence: 0.1: escrever mais de 0.5"),
        ("decision.ratio", 0.5, "decision.ratio: 0.5: escrever 1 ou mais"),
    ],
)
def test_every_fault_of_an_item_is_said_in_portuguese(path, value, text):
    tree = tomllib.loads(ITEM)
    *tables, key = path.split(".")
    table = tree
    for name in tables:
        table = table[name]
    table[key] = value
    with pytest.raises(ConfigError) as error:
        parse_section(ItemFile, tree, "item.toml")
    (found,) = item_in_words(str(error.value), load_translations("pt"))
    assert found.startswith(text)


def test_an_item_says_what_it_lacks(site, job, rows):
    tree = tomllib.loads(ITEM)
    del tree["item"]["toe"]["axis"]
    found = entered(site, job, rows, tree)
    assert found["item"] is None
    assert "toe has no axis" in found["item_faults"][0]
    assert entered(site, job, rows, "x = [")["item_faults"][0].startswith("item.toml: not valid")
    shown = entered(site, job, [], tomllib.loads(ITEM))
    assert [sheet["kind"] for sheet in shown["sheets"]] == ["toe", "camber"]
    points = [point["point"] for point in shown["sheets"][0]["points"]]
    assert points == ["RR", "RL", "FR", "FL", "1", "2", "3", "4"]
    assert "°" in shown["sheets"][0]["points"][0]["reference"]


def test_readings_of_another_sign_are_doubted(site, job, rows):
    other = ITEM.replace('positive = "toe-in"', 'positive = "toe-out"')
    assert "opposite sign" in entered(site, job, rows, other)["warnings"][0]


def test_an_item_is_written_as_it_is_read(tmp_path):
    item = item_of(TESTED).item.model_dump(exclude_none=True)
    item |= {"maker": 'A "B" \\ é \x7f 😀', "rim": "16in"}
    given = ItemFile.model_validate({"item": item, "decision": {"rule": "shared", "ratio": 4.0}})
    (tmp_path / "item.toml").write_text(item_toml(given), encoding="utf-8")
    assert load_item(tmp_path / "item.toml") == given


def test_every_choice_of_an_item_has_a_name_in_each_language():
    for language in ("en", "pt"):
        found = choices(load_translations(language))
        assert len(found["quantities"]) == 9
        for one in found["quantities"]:
            assert one["name"]
            assert all(text for _, text in one["senses"])
            assert (one["kind"] == "track") == (one["senses"] == [])


# The certificate


def test_the_certificate_is_a_draft_until_nothing_is_missing(site, job, rows):
    assert saved(site, job, rows, "draft").status_code == 200
    page = site.get(f"/api/jobs/{job}/certificate.html")
    assert "sandbox" in page.headers["Content-Security-Policy"]
    assert "the customer is missing" in page.text
    assert "the name of the laboratory is missing" not in page.text  # the settings state it
    assert saved(site, job, rows, "issued", certificate=CERTIFICATE_TOML).status_code == 200
    page = site.get(f"/api/jobs/{job}/certificate.html").text
    assert "is missing" not in page
    assert "Laboratory 7" in page
    wrong = saved(site, job, rows, "not", certificate=CERTIFICATE_TOML + "x = 1\n")
    assert wrong.json["error"].startswith("certificate.toml: ")


def test_without_settings_the_laboratory_is_missing(tmp_path, rows):
    site = Site(tmp_path)
    try:
        site.copy(PAPER, "figure-4.txt")
        job = site.measure({"root": 0, "path": "figure-4.txt"})["id"]
        some = [row for row in rows if row[0] in ("RR", "RL")]
        assert site.get(f"/api/jobs/{job}/certificate.html").status_code == 404
        assert saved(site, job, some, "draft").status_code == 200
        page = site.get(f"/api/jobs/{job}/certificate.html").text
        assert "the name of the laboratory is missing" in page
    finally:
        site.close()


# Limits


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"item": 3, "readings": []},
        {"item": {}, "readings": "x"},
        {"item": {}, "readings": [["1"] * 9]},
        {"item": {}, "readings": [["1"] * 9 + [1]]},
        {"item": {}, "readings": [["1"] * 9 + ["a\nb"]]},
        {"item": {}, "readings": [["1"] * 9 + ["x" * 201]]},
        {"item": {}, "readings": [], "certificate": ["x"]},
    ],
)
def test_requests_of_another_form_are_refused(site, job, given):
    assert site.post(f"/api/jobs/{job}/calibration", given).status_code == 400
    save = site.post(f"/api/jobs/{job}/calibration/save", {**given, "root": 0, "name": "x"})
    assert save.status_code == 400
    assert not (site.allowed / "x").exists()


def test_sizes_are_limited(site, job, rows):
    address = f"/api/jobs/{job}/calibration"
    many = [rows[0]] * 5001
    answer = site.post(address, {"item": {}, "readings": many})
    assert answer.status_code == 413
    assert "more than 5000 readings" in answer.json["error"]
    assert site.post(address, {"item": "x" * 1_000_000, "readings": []}).status_code == 413
    big = {"item": "#" * 150_000, "readings": []}
    assert site.post(address, big).status_code == 200  # more than other requests may have
    assert site.post(f"/api/jobs/{job}/calibration/x", big).status_code in (404, 413)
    assert site.put(f"/api/jobs/{job}/readings/a.csv", bytes((16 << 20) + 1)).status_code == 413


@pytest.mark.parametrize("name", ["a.toml", "a.csv.exe", ".a.csv", "a\\b.csv", "%2e%2e%2fa.csv"])
def test_tables_have_plain_names(site, job, name):
    assert site.put(f"/api/jobs/{job}/readings/{name}", b"x").status_code in (400, 404, 415)


@pytest.mark.parametrize(
    "place",
    [
        {"root": 0, "name": "../out"},
        {"root": 0, "name": "capture"},
        {"root": 0, "name": ""},
        {"root": 1, "name": "x"},
        {"root": "0", "name": "x"},
        {"root": 0, "path": "..", "name": "x"},
        {"root": 0, "path": "gone", "name": "x"},
    ],
)
def test_it_is_saved_to_a_new_folder_of_an_allowed_one(site, job, rows, place):
    given = {"item": ITEM, "readings": rows, **place}
    answer = site.post(f"/api/jobs/{job}/calibration/save", given)
    assert answer.status_code in (400, 403, 404, 409), answer.json
    assert not (site.allowed.parent / "out").exists()


def test_only_a_measurement_of_this_session_is_calibrated_against(site, job, rows):
    given = {"item": ITEM, "readings": rows}
    assert site.post("/api/jobs/gone/calibration", given).status_code == 404
    for method, path in (("POST", "calibration"), ("POST", "calibration/save"),
                         ("PUT", "readings/a.csv")):  # fmt: skip
        headers = {"X-Wheelplane-Key": None}
        answer = site.ask(method, f"/api/jobs/{job}/{path}", headers=headers, json=given)
        assert answer.status_code == 403
