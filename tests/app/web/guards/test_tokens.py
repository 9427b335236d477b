"""Tokens: which role each has, and that a wrong one is handled exactly like a right one."""

from __future__ import annotations

import hmac

import pytest

from app.web.guards.tokens import Guesses, Tokens, network_of
from pipeline.common.errors import BadInput

PERSON, DISPLAY = "person-0123456789abcdef", "display-0123456789abcde"
TOKENS = Tokens(PERSON, DISPLAY)

GIVEN = {
    "the person's": (PERSON, "person"),
    "the display's": (DISPLAY, "display"),
    "nothing": (None, None),
    "empty": ("", None),
    "one letter short": (PERSON[:-1], None),
    "one letter more": (PERSON + "x", None),
    "in capitals": (PERSON.upper(), None),
    "not ASCII": ("\u00e9" * 20, None),
    "not even text": ("\udcff" * 20, None),
}


@pytest.mark.parametrize("name", GIVEN)
def test_whose_it_is_and_every_answer_compares_all(name: str, monkeypatch: pytest.MonkeyPatch):
    given, role = GIVEN[name]
    compared: list[tuple[int, int]] = []

    def counted(a: bytes, b: bytes) -> bool:
        compared.append((len(a), len(b)))
        return constant(a, b)

    constant = hmac.compare_digest
    monkeypatch.setattr(hmac, "compare_digest", counted)
    assert TOKENS.role_of(given) == role
    assert compared == [(32, 32), (32, 32)]


def test_tokens_are_made_up_anew_and_long():
    one, other = Tokens.from_environment({}), Tokens.from_environment({})
    assert len({one.person, one.display, other.person, other.display}) == 4
    assert min(len(one.person), len(one.display)) >= 32


def test_a_display_keeps_a_token_that_was_chosen():
    tokens = Tokens.from_environment({"CIPV_DISPLAY_TOKEN": DISPLAY})
    assert tokens.role_of(DISPLAY) == "display"
    assert tokens.role_of(tokens.person) == "person"


WEAK = {
    "short": {"CIPV_TOKEN": "secret"},
    "one letter": {"CIPV_TOKEN": "a" * 16},
    "few letters": {"CIPV_TOKEN": "abcabcabdabcabca"},
    "a word again and again": {"CIPV_DISPLAY_TOKEN": "password" * 4},
    "digits in order": {"CIPV_TOKEN": "1234567890123456"},
    "the alphabet": {"CIPV_TOKEN": "0123456789abcdefghij"},
    "letters twice each": {"CIPV_TOKEN": "aabbccddeeffgghh"},
    "with a space": {"CIPV_TOKEN": "a b" * 10},
    "with what a link would change": {"CIPV_DISPLAY_TOKEN": "abc&def=" * 4},
    "the same for both": {"CIPV_TOKEN": PERSON, "CIPV_DISPLAY_TOKEN": PERSON},
}


@pytest.mark.parametrize("name", WEAK)
def test_a_weak_token_is_refused(name: str):
    with pytest.raises(BadInput):
        Tokens.from_environment(WEAK[name])


def test_what_was_chosen_is_never_shown():
    tokens = Tokens.from_environment({"CIPV_DISPLAY_TOKEN": DISPLAY})
    assert tokens.shown("display") == "$CIPV_DISPLAY_TOKEN"
    assert tokens.shown("person") == tokens.person


def test_a_guesser_is_told_and_a_page_with_an_old_cookie_is_none():
    now_s = 0.0
    guesses = Guesses(clock=lambda: now_s)
    assert not any(guesses.wrong("a", "old") for _ in range(100))
    assert [guesses.wrong("a", f"guess {n}") for n in range(12)] == [False] * 9 + [True] * 3
    assert not guesses.wrong("b", "guess 0")
    now_s = 61.0
    assert not guesses.wrong("a", "guess 99")


@pytest.mark.parametrize(
    ("address", "network"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("2001:db8:1:2:aaaa::1", "2001:db8:1:2::/64"),
        ("2001:db8:1:2:bbbb::9", "2001:db8:1:2::/64"),
        ("2001:db8:1:3::1", "2001:db8:1:3::/64"),
        ("", ""),
        ("testclient", "testclient"),
    ],
)
def test_the_network_by_which_guesses_are_counted(address: str, network: str) -> None:
    assert network_of(address) == network


def test_a_guesser_who_changes_its_address_within_a_network_is_slowed_down() -> None:
    guesses = Guesses(allowed=10, clock=lambda: 0.0)
    slowed = [guesses.wrong(f"2001:db8:1:2::{number:x}", f"guess {number}") for number in range(20)]
    assert slowed == [False] * 10 + [True] * 10
    assert not guesses.wrong("2001:db8:1:3::1", "guess 0"), "others are not"


def test_a_guesser_who_claims_any_address_is_slowed_down() -> None:
    guesses = Guesses(clock=lambda: 0.0, allowed_to_all=50)
    slowed = [guesses.wrong(f"192.0.2.{number}", f"guess {number}") for number in range(100)]
    assert slowed == [False] * 50 + [True] * 50
