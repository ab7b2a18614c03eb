"""An identification as one page that a person understands, and as a table for a terminal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np
import xarray as xr

from finger_pin.files import write_text
from finger_pin.identification.misfit import SIGNIFICANCE
from finger_pin.views.document import document, image
from finger_pin.views.plots.identification import plot_identification, plot_predictions, plot_profiles, short_name

# From which correlation of neighbours residuals are said to follow each other.
_FOLLOWING = 0.9


def summarize_identification(result: xr.Dataset) -> str:
    """Return the table of an identification as text."""
    rows = [("", "estimate", "lower", "upper", "")]
    rows += _parameters(result)
    rows.append(("", "", "", "", ""))
    rows.append(("", "rms", "samples", "of them", ""))
    for name, noise, count, independent, unit in _signals(result):
        rows.append((name, noise, count, f"{independent} free", unit))
    width = max(len(row[0]) for row in rows)
    doubt = [line for each in _doubts(result) for line in (each, "")]
    lines = [f"  {a.ljust(width)}{b.rjust(13)}{c.rjust(13)}{d.rjust(13)}  {e}".rstrip() for a, b, c, d, e in rows]
    predicted = _predictions(result)
    return "\n".join([*predicted, *([""] if predicted else []), *doubt, *lines, "", *_words(result)])


def write_report(result: xr.Dataset, path: str | Path) -> Path:
    """Write the page, whole or not at all: figures are inside it, nothing is loaded from anywhere."""
    sections = [
        (
            "What was found",
            "".join(f"<p class='doubt'><strong>{escape(each)}</strong></p>" for each in _doubts(result))
            + _estimates(result)
            + image(plot_profiles(result), "Profiles")
            + f"<p class='soft'>{_PROFILES}</p>",
        ),
        ("What the recordings leave open", "".join(f"<p>{escape(line)}</p>" for line in _words(result))),
        ("How well every signal is met", _met(result) + image(plot_identification(result), "Signals")),
    ]
    predicted = "".join(f"<p>{escape(line)}</p>" for line in _predictions(result))
    if predicted:
        sections.insert(0, ("What was predicted", predicted + image(plot_predictions(result), "Predictions")))
    if "law" in result.dims:
        sections.append(("Which law", _laws(result)))
    if result.sizes["parameter"] > 1:
        sections.append(("How the estimates hang together", _correlations(result)))
    body = "".join(f"<section><h2>{title}</h2>{content}</section>" for title, content in sections)
    write_text(path, document(f"Identification: {result.attrs['scenario']}", body))
    return Path(path)


_PROFILES = (
    "Each curve shows how the fit worsens with one number held and the others fitted anew. "
    "It crosses the dashed line at the ends of the 95 % interval; without a crossing the interval is open on that side."
)


def _parameters(result: xr.Dataset) -> list[tuple[str, str, str, str, str]]:
    rows = []
    for one in (result.isel(parameter=k) for k in range(result.sizes["parameter"])):
        unit = str(one["units"].values)
        ends = (_end(float(one["lower"])), _end(float(one["upper"])))
        rows.append((str(one["parameter"].values), f"{float(one['estimate']):.5g}", *ends, "" if unit == "1" else unit))
    return rows


def _signals(result: xr.Dataset) -> list[tuple[str, str, str, str, str]]:
    columns = ("signal", "noise", "signal_samples", "independent_share", "signal_units")
    return [
        (str(name), f"{noise:.3g}", str(count), f"{share * count:.0f}", str(unit))
        for name, noise, count, share, unit in zip(*(result[each].values for each in columns), strict=True)
    ]


def _doubts(result: xr.Dataset) -> list[str]:
    """Return sentences on reasons for doubt: signals that are not met, searches that do not agree."""
    doubts = []
    for k, (name, *_, unit) in enumerate(_signals(result)):
        mask = result["signal_index"].values == k
        left, whole = (result[each].values[mask] for each in ("residual", "measured"))
        rms, varies = float(np.sqrt(np.mean(left**2))), float(np.std(whole))
        # A constant would leave as much as the signal varies by; half of its square and more is no fit.
        if rms**2 > 0.5 * varies**2:
            doubts.append(
                f"This is no fit of {name}: what is left over is {rms:.3g} {unit} rms, and the signal itself varies "
                f"by {varies:.3g} {unit}. Look at units, signs and columns."
            )
    return doubts if _borne_out(result) else [*doubts, _agreement(result)]


def _outliers(result: xr.Dataset) -> list[str]:
    """Return a sentence on outliers: samples that dominate the misfit of their signal."""
    words = []
    for k, (name, *_) in enumerate(_signals(result)):
        sizes = np.where(result["signal_index"].values == k, result["outlier"].values, 0.0)
        count, worst = int(np.count_nonzero(sizes)), int(np.argmax(sizes))
        if count:
            instant = float(result["instant"].values[worst])
            at = f"row {instant + 1.0:.0f}" if bool(result["signal_steady"].values[k]) else f"{instant:.6g} s"
            words.append(
                f"{name} has {count} outlier{'s' if count > 1 else ''}, the worst at {at}, {sizes[worst]:.3g} times as "
                "far from the law as others mostly are. Leave out what is a fault; with --robust it counts less."
            )
    return words


def _predictions(result: xr.Dataset) -> list[str]:
    """Return a sentence on every signal that was held out."""
    if "prediction" not in result.dims:
        return []
    columns = ("rms", "bias", "within", "scatter", "beyond", "samples", "units")
    rows = zip(result["prediction"].values, *(result[f"prediction_{each}"].values for each in columns), strict=True)
    sentences = []
    for name, rms, bias, within, scatter, beyond, count, unit in rows:
        share = "" if math.isnan(within) else f", {within:.0%} of {count} samples within the 95 % band"
        repeated = "" if math.isnan(scatter) else f"; repeats scatter by {scatter:.3g}"
        sentences.append(f"Held out: {name} is predicted to {rms:.3g} {unit} rms, bias {bias:.3g}{share}{repeated}.")
        if beyond > 0.0:
            sentences.append(
                f"{beyond:.0%} of these loads are beyond those that were fitted: the band does not know what the model "
                "lacks there."
            )
    return sentences


def _end(value: float) -> str:
    return "-" if math.isnan(value) else "open" if math.isinf(value) else f"{value:.5g}"


def _words(result: xr.Dataset) -> list[str]:
    """Return sentences on open questions, agreement of the searches, and the law to be preferred."""
    undetermined = (
        [str(each) for each in np.atleast_1d(result.attrs["undetermined"])] if "undetermined" in result.attrs else []
    )
    words = [f"Not determined: {each}." for each in undetermined if each]
    for name, _, low, high, _ in _parameters(result):
        sides = [side for side, end in (("below", low), ("above", high)) if end == "open"]
        if sides:
            words.append(f"{name} is not bounded from {' nor from '.join(sides)} by these recordings.")
    if not words and "unfinished" not in result.attrs:
        words.append(f"{'The' if _borne_out(result) else 'Near this place the'} recordings determine every parameter.")
    if _borne_out(result):
        words.append(_agreement(result))
    undamped = result.attrs.get("undamped", "")
    if undamped:
        words.append(
            f"Nothing damps {undamped}: where friction holds a joint it rings, and runs take ten times the steps. "
            "A little viscous friction of joints or tendons would change that."
        )
    if not result.attrs.get("profiles", 1):
        words.append("The intervals are those of slopes at the estimate: where they are wide, profiles are surer.")
    words += _outliers(result) + _misses(result)
    if "law" in result.dims:
        order = np.argsort(result["law_bic"].values)
        first, *others = (str(result["law"].values[k]) for k in order)
        bic = result["law_bic"].values[order]
        rest = ", ".join(f"{name} by {value - bic[0]:.0f}" for name, value in zip(others, bic[1:], strict=True))
        words.append(f"By BIC the law '{first}' is to be preferred: it is better than {rest} (10 is decisive).")
    if "unfinished" in result.attrs:
        words.append(f"{result.attrs['unfinished'].capitalize()}.")
    return words


def _misses(result: xr.Dataset) -> list[str]:
    """Return sentences on the model's misfit: by repeats, and by the correlation of residuals."""
    words, following = [], list[str]()
    columns = ("signal", "replicate_noise", "noise", "lack_of_fit", "signal_correlation", "signal_steady")
    for name, repeated, noise, chance, correlation, steady in zip(
        *(result[each].values for each in columns), strict=True
    ):
        if math.isfinite(repeated):
            what = "Equal readings" if steady else "Repeated runs"
            words.append(f"{what} of {name} differ by {repeated:.3g} rms, all from the law by {noise:.3g}.")
        if chance < SIGNIFICANCE:
            words.append(
                f"The model misses something of {name}: by chance alone it would miss as much with a probability of "
                f"{chance:.2g}. The intervals count that as noise which repeats share; numbers that take the place of "
                "what is missing may still be off."
            )
        elif math.isnan(chance) and correlation > _FOLLOWING:
            following.append(str(name))
    if following:
        words.append(
            f"Residuals of {', '.join(following)} follow each other: sensor or model, which repeats would tell. "
            "The intervals count them as noise with that correlation."
        )
    return words


def _agreement(result: xr.Dataset) -> str:
    """Return a sentence on the agreement of the searches."""
    agreeing, count = int(result.attrs["searches_alike"]), int(result.attrs["searches"])
    if count == 1:
        return "There was one search: whether the recordings are met better elsewhere is not known."
    if _borne_out(result):
        return f"{agreeing} of {count} searches end at the same place."
    return (
        f"Do not trust these intervals: only {agreeing} of {count} searches end at this place, the others where the "
        "recordings are met worse. There may be a better place still, and an interval says nothing of it. "
        "Narrower bounds, shorter windows or more starts help."
    )


def _borne_out(result: xr.Dataset) -> bool:
    """Return whether the best minimum was found by at least two searches and by half of them, or by the only one."""
    agreeing, count = int(result.attrs["searches_alike"]), int(result.attrs["searches"])
    return count == 1 or (agreeing >= 2 and 2 * agreeing >= count)


def _table(head: Sequence[str], rows: Sequence[tuple[str, ...]]) -> str:
    top = "".join(f"<th{' class=number' if k else ''}>{escape(each)}</th>" for k, each in enumerate(head))
    # On a phone a key breaks behind its dots, not inside words.
    keys = [escape(key).replace(".", ".<wbr>") for key, *_ in rows]
    numbers = ["".join(f"<td class=number>{escape(each)}</td>" for each in row) for _, *row in rows]
    body = "".join(f"<tr><td>{key}</td>{cells}</tr>" for key, cells in zip(keys, numbers, strict=True))
    return f"<table><tr>{top}</tr>{body}</table>"


def _estimates(result: xr.Dataset) -> str:
    return _table(["parameter", "estimate", "lower (95 %)", "upper (95 %)", "unit"], list(_parameters(result)))


def _met(result: xr.Dataset) -> str:
    head = ["signal", "rms left over", "samples", "of them independent", "unit"]
    return _table(head, list(_signals(result)))


def _laws(result: xr.Dataset) -> str:
    columns = ("law", "law_parameters", "law_bic", "law_rms", "law_held_out")
    rows = [
        (str(name), str(count), f"{bic:.1f}", f"{rms:.3f}", "-" if math.isnan(out) else f"{out:.3f}")
        for name, count, bic, rms, out in zip(*(result[each].values for each in columns), strict=True)
    ]
    head = ["law", "parameters", "BIC (less is better)", "rms over noise", "rms of the held-out samples"]
    return _table(head, rows)


def _correlations(result: xr.Dataset) -> str:
    names = [str(each) for each in result["parameter"].values]
    values = result["correlation"].values
    rows = [(name, *(f"{value:.2f}" for value in row)) for name, row in zip(names, values, strict=True)]
    return _table(["", *map(short_name, names)], rows)
