"""Tests of notes in the language of a report: every sentence, of a measurement and as stored."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import wheelplane
from tests.support.reported import measured
from tests.support.wordings import PART, sentences, texts
from wheelplane.config import InstrumentConfig
from wheelplane.errors import Wording
from wheelplane.measurement import notes_of_assumptions
from wheelplane.report.format.language import Translations, load_translations
from wheelplane.report.format.notes import notes_in
from wheelplane.targets import load_target

ROOT = Path(wheelplane.__file__).parent
ROOMS = [ROOT / room for room in ("capture", "detection", "diagnostics", "five_point",
                                  "measurement", "validation")]  # fmt: skip
EN, PT = load_translations("en"), load_translations("pt")
KNOWN = {key: text for key, text in EN.section("note").items() if key != "and"}


def test_texts_are_read_when_one_is_asked_for():
    """A measurement that is printed as JSON needs none of them."""
    words = Translations("en")
    assert "texts" not in vars(words)
    assert words.wheel("RR") == "RR"
    assert "texts" in vars(words)


def test_every_note_has_words_and_every_word_is_of_a_note():
    assert sentences(*ROOMS) <= set(KNOWN.values())
    others = ROOT / "calibration", ROOT / "web" / "content"  # whose doubts are notes
    assert set(KNOWN.values()) <= texts(*ROOMS, *others)


@pytest.mark.parametrize("key", KNOWN)
def test_a_note_is_found_by_its_sentence_as_it_was_stored(key):
    parts = {name: f"{number}.5" for number, name in enumerate(PART.findall(KNOWN[key]))}
    note = Wording(KNOWN[key], **parts)
    assert notes_in([note], EN) == (note,)
    said = notes_in([note], PT)
    assert said == notes_in([str(note)], PT)
    forms = {*parts.values(), *(part.replace(".", ",") for part in parts.values())}
    assert PART.sub("", PT(f"note.{key}", **dict.fromkeys(parts, "{x}"))) == re.sub(
        "|".join(map(re.escape, forms)), "", said[0]
    )


def test_wheels_numbers_and_phrases_within_a_note_are_those_of_the_language():
    zeros = "range bias, collimation and pointing of the scanner; flatness of the target"
    cases = {
        "The angles of RR, 1 and FL are those of the axle, compensated for run-out.":
            "Os ângulos de TD, 1 e FE são os do eixo da roda, compensados do empeno.",
        f"Counted as zero, as no file states them: {zeros}.":
            "Conta como zero, por nenhum ficheiro o indicar: erro de distância, colimação e "
            "pontaria do scanner; planeza do alvo.",
        "Wheels named by the geometry; front: --front 1,0,0; up: the floor, 0.31 m below the "
        "wheels' centres, and the z axis, 0.4° off.":
            "Rodas identificadas pela geometria; frente: --front 1,0,0; cima: o chão, 0,31 m "
            "abaixo dos centros das rodas, e o eixo z, a 0,4° deste.",
        "scan.1.5.ply: 1 of 20 points lies 9.9 km from the others: check its export.":
            "scan.1.5.ply: 1 de 20 pontos está a 9,9 km dos outros: verificar a exportação.",
        "RL: The operator chose the target at (1.000, 2.000, 0.300) m (in the way); the match of "
        "its outline is 0.41 (0.50 needed where nobody chooses).":
            "TE: O operador escolheu o alvo em (1,000, 2,000, 0,300) m (in the way); a semelhança "
            "do contorno é 0,41 (0,50 seria preciso sem essa escolha).",
        "Ranges follow brightness: bright parts of the target lie nearer to the scanner than its "
        "dark ones, across its plane, by +0.21 mm (RR), +0.30 mm (FL). This is fitted with the "
        "plane and removed; a target of one brightness avoids it.":
            "As distâncias seguem o brilho: as partes claras do alvo ficam mais perto do scanner "
            "do que as escuras, através do plano, por +0,21 mm (TD), +0,30 mm (FE). Isto é "
            "ajustado com o plano e removido; um alvo de um só brilho evita-o.",
        "A note of another version.": "A note of another version.",
    }  # fmt: skip
    assert notes_in(cases, PT) == tuple(cases.values())
    assert notes_in(cases, EN) == tuple(cases)


def test_a_measurement_has_no_note_without_words():
    notes = notes_of_assumptions(measured(1), load_target("disc-250"), InstrumentConfig())
    assert len(notes) > 1
    assert all(isinstance(note, Wording) for note in notes)
    assert not set(notes) & set(notes_in(notes, PT))
