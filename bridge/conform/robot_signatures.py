"""Requirements on message signatures: a robot with keys refuses every query without a valid one."""

from __future__ import annotations

from stopgo.bridge.conform import falsified_signatures as falsified
from stopgo.bridge.conform.falsified_signatures import Falsifying
from stopgo.bridge.conform.requirements import Nonconforming, NotTried, Requirement, must
from stopgo.bridge.conform.robot_bench import RobotBench
from stopgo.bridge.conform.robot_queries import describe, must_reject, read_reply
from stopgo.bridge.link.protocol import Info, LogPage, encode

NO_KEYS = "the link has no keys: --keys DIR"


def _must_be_untrusted(bench: RobotBench, falsify: Falsifying, what: str) -> None:
    """Send queries and a command with falsified signatures; all must be refused."""
    if bench.forger is None:
        raise NotTried(NO_KEYS)
    bench.forger.signing.falsify = falsify
    for key, payload, parameters in (
        (bench.keys.info, b"", {}),
        (bench.keys.log, b"", {"since": "0"}),
        (bench.keys.command("pause"), encode(bench.commands.order("pause", issued_ns=0)), {}),
    ):
        raw = bench.forger.link.ask(key, payload, timeout_s=bench.timeout_s, parameters=parameters)
        must(raw is not None, f"a question {what} was not answered; it is to be refused as untrusted")
        reply = read_reply(raw or b"")
        must(not isinstance(reply, Info | LogPage), f"a question {what} was answered with {describe(reply)}")
        must_reject(reply, "untrusted")


def unsigned_is_untrusted(bench: RobotBench) -> None:
    _must_be_untrusted(bench, falsified.unsigned, "without a signature")


def wrong_signatures_are_untrusted(bench: RobotBench) -> None:
    _must_be_untrusted(bench, falsified.flipped, "with a wrong signature")


def signatures_are_for_one_key(bench: RobotBench) -> None:
    _must_be_untrusted(bench, falsified.of_another_key, "with the signature of another key")


def signatures_are_for_one_payload(bench: RobotBench) -> None:
    _must_be_untrusted(bench, falsified.of_another_payload, "with the signature of other bytes")


def signatures_are_for_their_parameters(bench: RobotBench) -> None:
    _must_be_untrusted(bench, falsified.of_other_parameters, "with the signature of other parameters")


def certificates_are_needed(bench: RobotBench) -> None:
    _must_be_untrusted(bench, falsified.without_certificate, "without a certificate")


def orders_are_given_in_ones_own_name(bench: RobotBench) -> None:
    if bench.forger is None:
        raise NotTried(NO_KEYS)
    order = bench.commands.order("pause", issued_ns=0, commander="somebody-else")
    must_reject(bench.ask(bench.keys.command("pause"), encode(order)), "untrusted")


def publications_are_signed(bench: RobotBench) -> None:
    """The link delivers only publications whose signature is valid."""
    if bench.forger is None:
        raise NotTried(NO_KEYS)
    bench.info()
    before = len(bench.published.states)
    try:
        bench.wait(lambda: len(bench.published.states) > before or None, bench.timeout_s, "")
    except Nonconforming:
        why = bench.link.distrusted or "none came"
        raise Nonconforming(f"no state with a valid signature was received ({why})") from None


SIGNATURE_REQUIREMENTS: tuple[Requirement[RobotBench], ...] = tuple(
    Requirement("Signatures", text, test)
    for text, test in (
        ("a query without a signature: `untrusted`", unsigned_is_untrusted),
        ("a wrong signature: `untrusted`", wrong_signatures_are_untrusted),
        ("a signature is valid on its own key expression only", signatures_are_for_one_key),
        ("a signature is valid for its own bytes only", signatures_are_for_one_payload),
        ("a signature is valid for its own parameters only", signatures_are_for_their_parameters),
        ("a question without a certificate: `untrusted`", certificates_are_needed),
        ("a command in another's name: `untrusted`", orders_are_given_in_ones_own_name),
        ("states are signed, numbered and fresh", publications_are_signed),
    )
)
