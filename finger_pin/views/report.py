"""An identification as one page that a person understands, and as a table for a terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from finger_pin.files import write_text
from finger_pin.views.document import document, image
from finger_pin.views.plots.identification import (
    plot_identification,
    plot_predictions,
    plot_profiles,
    profiled_parameters,
    short_name,
)

# Ratio of the noises of one output in two recordings from which that is said: weights of 1 to 9.
_NOISE_RATIO = 3.0
# Shift of an estimate without a recording, over that by noise alone, from which recordings are said to disagree: one in
# a hundred by chance.
_SHIFT_DEVIATIONS = 2.58
# Correlation of neighbours over its deviation of white residuals, 1 / sqrt(n), from which they are said to follow each
# other: one in a thousand by chance.
_CORRELATION_DEVIATIONS = 3.0


def summarize_identification(result: xr.Dataset) -> str:
    """Return the table of an identification as text."""
    rows: list[tuple[str, ...]] = [("", "estimate", "lower", "upper", ""), *_parameters(result)]
    rows += [("", "", "", "", ""), ("", "rms", "samples", "of them", "")]
    rows += [(*row, f"{independent} free", unit) for *row, independent, unit in _signals(result)]
    width = max(len(row[0]) for row in rows)
    doubts = [line for doubt in _doubts(result) for line in (doubt, "")]
    lines = [
        f"  {name.ljust(width)}{value.rjust(13)}{lower.rjust(13)}{upper.rjust(13)}  {unit}".rstrip()
        for name, value, lower, upper, unit in rows
    ]
    predictions = _predictions(result)
    return "\n".join([*doubts, *lines, "", *predictions, *([""] if predictions else []), *_remarks(result)])


def write_report(result: xr.Dataset, path: str | Path) -> Path:
    """Write the page, whole or not at all: figures are inside it, nothing is loaded from anywhere."""
    head = ["signal", "rms left over", "samples", "of them independent", "unit"]
    profiles = ""
    if profiled_parameters(result):
        profiles = image(plot_profiles(result), "Profiles") + f"<p class='soft'>{_PROFILES_NOTE}</p>"
    sections = [
        (
            "What was found",
            _paragraphs(_doubts(result), "<p class='doubt'><strong>{}</strong></p>")
            + _table(["parameter", "estimate", "lower (95 %)", "upper (95 %)", "unit"], _parameters(result))
            + profiles,
        ),
        ("What the recordings leave open", _paragraphs(_remarks(result))),
        (
            "How well every signal is met",
            _table(head, _signals(result)) + image(plot_identification(result), "Signals"),
        ),
    ]
    if predictions := _paragraphs(_predictions(result)):
        sections.insert(1, ("What was predicted", predictions + image(plot_predictions(result), "Predictions")))
    if "law" in result.dims:
        sections.append(("Which law", _law_table(result)))
    if result.sizes["parameter"] > 1:
        sections.append(("How the estimates hang together", _correlation_table(result)))
    body = "".join(f"<section><h2>{title}</h2>{content}</section>" for title, content in sections)
    write_text(path, document(f"Identification: {result.attrs['scenario']}", body))
    return Path(path)


def _paragraphs(sentences: Sequence[str], form: str = "<p>{}</p>") -> str:
    return "".join(form.format(escape(sentence)) for sentence in sentences)


def _rows(result: xr.Dataset, *columns: str) -> Iterator[tuple[Any, ...]]:
    """Return the values of variables along their dimension, together."""
    return zip(*(result[column].values for column in columns), strict=True)


_PROFILES_NOTE = (
    "Each curve shows how the fit worsens with one number held and the others fitted anew. "
    "It crosses the dashed line at the ends of the 95 % interval; without a crossing the interval is open on that side."
)


def _parameters(result: xr.Dataset) -> list[tuple[str, str, str, str, str]]:
    rows = []
    for entry in (result.isel(parameter=index) for index in range(result.sizes["parameter"])):
        unit = str(entry["units"].values)
        ends = (_bound_text(float(entry["lower"])), _bound_text(float(entry["upper"])))
        rows.append(
            (str(entry["parameter"].values), f"{float(entry['estimate']):.5g}", *ends, "" if unit == "1" else unit)
        )
    return rows


def _signals(result: xr.Dataset) -> list[tuple[str, str, str, str, str]]:
    rows = _rows(result, "signal", "noise", "signal_samples", "independent_share", "signal_units")
    return [
        (str(name), f"{noise:.3g}", str(count), f"{share * count:.0f}", str(unit))
        for name, noise, count, share, unit in rows
    ]


def _doubts(result: xr.Dataset) -> list[str]:
    """Return sentences on reasons for doubt: signals that the model does not fit, searches that disagree."""
    doubts = []
    for index, (name, *_, unit) in enumerate(_signals(result)):
        mask = result["signal_index"].values == index
        residual, measured = (result[variable].values[mask] for variable in ("residual", "measured"))
        rms, variation = float(np.sqrt(np.mean(residual**2))), float(np.std(measured))
        # A constant model leaves the variation of the signal; half of its square and more is no fit.
        if rms**2 > 0.5 * variation**2:
            doubts.append(
                f"This is no fit of {name}: what is left over is {rms:.3g} {unit} rms, and the signal itself varies "
                f"by {variation:.3g} {unit}. Look at units, signs and columns."
            )
    return doubts if _confirmed(result) else [*doubts, _agreement(result)]


def _outliers(result: xr.Dataset) -> list[str]:
    """Return a sentence on outliers: samples that dominate the misfit of their signal."""
    sentences = []
    for index, (name, *_) in enumerate(_signals(result)):
        sizes = np.where(result["signal_index"].values == index, result["outlier"].values, 0.0)
        count, worst = int(np.count_nonzero(sizes)), int(np.argmax(sizes))
        if count:
            instant = float(result["instant"].values[worst])
            place = f"row {instant + 1.0:.0f}" if bool(result["signal_steady"].values[index]) else f"{instant:.6g} s"
            sentences.append(
                f"{name} has {count} outlier{'s' if count > 1 else ''}, the worst at {place}, {sizes[worst]:.3g} times "
                "as far from the law as others mostly are. Leave out what is a fault; with --robust it counts less."
            )
    return sentences


def _predictions(result: xr.Dataset) -> list[str]:
    """Return a sentence on every signal that was held out."""
    if "prediction" not in result.dims:
        return []
    columns = ("rms", "bias", "within", "band_ratio", "scatter", "beyond", "samples", "units")
    rows = _rows(result, "prediction", *(f"prediction_{column}" for column in columns))
    sentences = []
    for name, rms, bias, within, ratio, scatter, beyond, count, unit in rows:
        band = f", {within:.0%} of {count} samples within the 95 % band, half of which is {ratio:.2g} times 1.96 rms"
        share = "" if math.isnan(within) else band
        repeats = "" if math.isnan(scatter) else f"; repeats scatter by {scatter:.3g}"
        sentences.append(f"Held out: {name} is predicted to {rms:.3g} {unit} rms, bias {bias:.3g}{share}{repeats}.")
        if beyond > 0.0:
            sentences.append(
                f"{beyond:.0%} of these loads are beyond those that were fitted: the band does not know what the model "
                "lacks there."
            )
    return sentences


def _bound_text(value: float) -> str:
    return "-" if math.isnan(value) else "open" if math.isinf(value) else f"{value:.5g}"


def _remarks(result: xr.Dataset) -> list[str]:
    """Return sentences on open questions, agreement of the searches, and the law to be preferred."""
    undetermined = np.atleast_1d(result.attrs.get("undetermined", ""))
    sentences = [f"Not determined: {name}." for name in undetermined if name]
    for name, _, low, high, _ in _parameters(result):
        sides = [side for side, end in (("below", low), ("above", high)) if end == "open"]
        if sides:
            sentences.append(f"{name} is not bounded from {' nor from '.join(sides)} by these recordings.")
    misfit_remarks, law_holds = _misfit_remarks(result)
    if not sentences and "unfinished" not in result.attrs:
        subject = "The" if _confirmed(result) else "Near this place the"
        determined = f"{subject} recordings determine every parameter."
        sentences.append(determined if law_holds else "All intervals close, under this law.")
    sentences += _disagreements(result)
    if _confirmed(result):
        sentences.append(_agreement(result))
    if result.attrs.get("ringing", ""):
        sentences.append(f"Runs take long: {result.attrs['ringing']}.")
    if not result.attrs.get("profiles", 1):
        sentences.append("The intervals are those of slopes at the estimate: where they are wide, profiles are surer.")
    if not result.attrs.get("refits", 1):
        sentences.append("No recording was left out by a refit: bands of predictions may be too narrow.")
    sentences += _outliers(result) + misfit_remarks
    if "law" in result.dims:
        order = np.argsort(result["law_bic"].values)
        best, *others = (str(result["law"].values[index]) for index in order)
        bic = result["law_bic"].values[order]
        margins = ", ".join(f"{name} by {value - bic[0]:.0f}" for name, value in zip(others, bic[1:], strict=True))
        sentences.append(f"By BIC the law '{best}' is to be preferred: it is better than {margins} (10 is decisive).")
    if "unfinished" in result.attrs:
        sentences.append(f"{result.attrs['unfinished'].capitalize()}.")
    return sentences


def _misfit_remarks(result: xr.Dataset) -> tuple[list[str], bool]:
    """Return sentences on the model's misfit, by repeats and correlation of residuals, and whether none shows."""
    sentences, correlated, law_holds = [], list[str](), True
    significance = result["lack_of_fit"].attrs.get("significance", 0.01)  # results before 0.7 do not say it
    columns = ("signal", "replicate_noise", "noise", "lack_of_fit", "signal_correlation", "signal_samples")
    rows = _rows(result, *columns, "signal_steady")
    for name, repeats, noise, chance, correlation, count, steady in rows:
        if math.isfinite(repeats):
            kind = "Equal readings" if steady else "Repeated runs"
            sentences.append(f"{kind} of {name} differ by {repeats:.3g} rms, all from the law by {noise:.3g}.")
        if chance < significance:
            law_holds = False
            sentences.append(
                f"The model misses something of {name}: by chance alone it would miss as much with a probability of "
                f"{chance:.2g}. The intervals count that as noise which repeats share; numbers that take the place of "
                "what is missing may still be off."
            )
        elif math.isnan(chance) and correlation * math.sqrt(count) > _CORRELATION_DEVIATIONS:
            correlated.append(f"{name} (by {correlation:.2g})")
    if correlated:
        sentences.append(
            f"Residuals of {', '.join(correlated)} follow each other: sensor or model, which repeats would tell. "
            "The intervals count them as noise with that correlation, and do not heed what the model lacks."
        )
    return sentences, law_holds and not correlated


def _disagreements(result: xr.Dataset) -> list[str]:
    """Return sentences on recordings that differ: by what they are met by, and by the parameters that they want."""
    sentences, signals = list[str](), [str(name).partition(".") for name in result["signal"].values]
    noises = [float(noise) for noise in result["noise"].values]
    for output in dict.fromkeys(name for _, _, name in signals):
        pairs = zip(noises, signals, strict=True)
        members = sorted((noise, recording) for noise, (recording, _, name) in pairs if name == output)
        (least, best), (greatest, worst) = members[0], members[-1]
        if greatest > _NOISE_RATIO * least:
            sentences.append(
                f"{output} of {worst} is met to {greatest:.3g}, that of {best} to {least:.3g}: each recording is "
                f"weighed by its own noise, so that {worst} hardly counts where the two want different numbers."
            )
    if "left_out" not in result.dims:
        return sentences
    names = result["left_out"].values
    columns = (result[name].values.T for name in ("left_out_estimate", "left_out_shift", "lower", "upper"))
    for refits, shifts, low, high, (key, _, lower, upper, unit) in zip(*columns, _parameters(result), strict=True):
        pair = int(np.argmin(refits)), int(np.argmax(refits))
        outside = (refits < low) | (refits > high)
        if any(outside[k] and abs(shifts[k]) > _SHIFT_DEVIATIONS for k in pair):
            values = [f"{refits[k]:.4g}{unit and f' {unit}'} without {names[k]}" for k in pair]
            sentences.append(
                f"{key} is {values[0]} and {values[1]}: these want it to differ by more than noise explains, which the "
                f"interval from {lower} to {upper} does not heed."
            )
    return sentences


def _agreement(result: xr.Dataset) -> str:
    """Return a sentence on the agreement of the searches."""
    agreeing, count = result.attrs["searches_alike"], result.attrs["searches"]
    if count == 1:
        return "There was one search: whether the recordings are met better elsewhere is not known."
    if _confirmed(result):
        return f"{agreeing} of {count} searches end at the same place."
    return (
        f"Do not trust these intervals: only {agreeing} of {count} searches end at this place, the others where the "
        "recordings are met worse. There may be a better place still, and an interval says nothing of it. "
        "Narrower bounds, shorter windows or more starts help."
    )


def _confirmed(result: xr.Dataset) -> bool:
    """Return whether the best minimum was found by at least two searches and by half of them, or by the only one."""
    agreeing, count = result.attrs["searches_alike"], result.attrs["searches"]
    return bool(count == 1 or (agreeing >= 2 and 2 * agreeing >= count))


def _table(header: Sequence[str], rows: Sequence[tuple[str, ...]]) -> str:
    top = "".join(f"<th{' class=number' if k else ''}>{escape(each)}</th>" for k, each in enumerate(header))
    # On narrow screens a key breaks after its dots, not inside words.
    keys = [escape(key).replace(".", ".<wbr>") for key, *_ in rows]
    numbers = ["".join(f"<td class=number>{escape(each)}</td>" for each in row) for _, *row in rows]
    body = "".join(f"<tr><td>{key}</td>{cells}</tr>" for key, cells in zip(keys, numbers, strict=True))
    return f"<table><tr>{top}</tr>{body}</table>"


def _law_table(result: xr.Dataset) -> str:
    columns = ("law", "law_parameters", "law_bic", "law_rms", "law_held_out")
    rows = [
        (str(name), str(count), f"{bic:.1f}", f"{rms:.3f}", "-" if math.isnan(held_out) else f"{held_out:.3f}")
        for name, count, bic, rms, held_out in _rows(result, *columns)
    ]
    header = ["law", "parameters", "BIC (less is better)", "rms over noise", "rms of the held-out samples"]
    return _table(header, rows)


def _correlation_table(result: xr.Dataset) -> str:
    rows = [(str(name), *(f"{value:.2f}" for value in row)) for name, row in _rows(result, "parameter", "correlation")]
    return _table(["", *(short_name(name) for name, *_ in rows)], rows)
