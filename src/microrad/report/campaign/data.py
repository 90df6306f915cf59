"""A campaign as plain data, in SI units."""

from dataclasses import asdict
from typing import Any

from microrad.campaign.records import CampaignSummary, CellSummary, OutputSummary, Tail
from microrad.report.campaign import words
from microrad.report.campaign.tables import good, unit_of


def campaign_data(summary: CampaignSummary) -> dict[str, Any]:
    """The summary as plain data in SI units, each output with its unit; single rows and traces are the export's."""
    return {
        "name": summary.name,
        "mission": summary.mission_name,
        "verdict": words.headline(summary),
        "findings": list(summary.findings),
        "hashes": dict(summary.hashes),
        "seed": summary.seed,
        "sampling": summary.sampling,
        "loop": summary.loop,
        "inputs": [asdict(each) for each in summary.inputs],
        "set": dict(summary.fixed),
        "limits": [{**asdict(limit), "unit": unit_of(summary, limit.output)} for limit in summary.limits],
        "cells": [_cell_data(cell) for cell in summary.cells],
        "sensitivities": [asdict(each) for each in summary.sensitivities],
        "worst": [{key: getattr(each, key) for key in ("cell", "row", "output", "value")} for each in summary.worst],
        "failed": [{"cell": cell, **asdict(each)} for cell, each in summary.failed],
        "progress": asdict(summary.progress),
        "warnings": list(summary.warnings),
    }


def _cell_data(cell: CellSummary) -> dict[str, Any]:
    return {
        "values": dict(cell.values),
        "rows": good(cell),
        "failed": cell.failed,
        "missed": asdict(cell.missed),
        "missed_by": {name: asdict(missed) for name, missed in cell.missed_by.items()},
        "outputs": [_output_data(output) for output in cell.outputs.values()],
        "tail": None if cell.tail is None else _tail_data(cell.tail),
    }


def _output_data(output: OutputSummary) -> dict[str, Any]:
    return {
        **{key: getattr(output, key) for key in ("name", "unit", "meaning", "rows", "deviation", "least", "most")},
        "mean": asdict(output.mean),
        "quantiles": [{"probability": p, **asdict(each)} for p, each in output.quantiles.items()],
        "edges": output.edges.tolist(),
        "counts": output.counts.tolist(),
    }


def _tail_data(tail: Tail) -> dict[str, Any]:
    curves = {key: getattr(tail, key).tolist() for key in ("radius_rad", "survival", "low", "high")}
    wanted = [{"probability": p, "unit": "rad", **asdict(each)} for p, each in tail.wanted.items()]
    kept = {key: getattr(tail, key) for key in ("confidence", "method", "effective_runs")}
    past = [{"error_rad": error, **asdict(each)} for error, each in tail.beyond.items()]
    past = [each | {"variance": tail.variance.get(each["error_rad"])} for each in past]
    return {**curves, "wanted": wanted, "beyond": past, **kept}
