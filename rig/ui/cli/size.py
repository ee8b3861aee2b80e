"""`rig size`: sizing of a ball-screw axis, with the entries of a catalogue assessed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from planners.errors import unknown_name
from rig.errors import REFUSED, ConfigError
from rig.run.toml_file import read_toml
from rig.studies.sizing.axis_experiment import experiment_text
from rig.studies.sizing.axis_file import EXAMPLES, Sizing, example_tables, sizing_of
from rig.studies.sizing.judgement import document, judge
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import print_json
from rig.ui.cli.page import print_written
from rig.ui.cli.size_tables import print_tables
from rig.ui.plots.picture_file import check_folder


def size(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="TOML file of the axis; sections axis, screw and move, others optional.",
            metavar="SPEC.toml",
        ),
    ] = None,
    example: Annotated[
        str | None,
        typer.Option(
            help=f"Worked example of source 004 instead of a file: {' or '.join(EXAMPLES)}."
        ),
    ] = None,
    entry: Annotated[
        str | None,
        typer.Option(
            help="Catalogue entry to assess; the choice in the file by default.",
            metavar="NAME",
        ),
    ] = None,
    published: Annotated[
        bool,
        typer.Option(
            "--published",
            help="Show all printed figures of the source, not only those that differ.",
        ),
    ] = False,
    every: Annotated[
        bool, typer.Option("--all", help="List the violated limits of each rejected entry.")
    ] = False,
    plot: Annotated[
        Path | None,
        typer.Option(help="Figure file of diameters, leads and catalogue: .svg, .png or .pdf."),
    ] = None,
    experiment: Annotated[
        Path | None,
        typer.Option(
            help="Experiment file to write: `rig run` then moves a load on this axis.",
            metavar="FILE.toml",
        ),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Check speed, buckling, life, lead, stiffness and motor of a ball-screw axis.

    Give a SPEC.toml or --example. Without a choice in it, the catalogue entry with the greatest
    least margin is assessed. Exit code 3 when the assessed screw is not admissible.
    """
    sizing = _read(file, example)
    if entry is not None:
        if entry not in sizing.catalogue:
            raise unknown_name("--entry", entry, sizing.catalogue)
        chosen = sizing.catalogue[entry]
        # printed figures hold for the choice in the file only
        published_figures = sizing.published if chosen is sizing.choice else {}
        sizing = sizing._replace(choice=chosen, published=published_figures)
    result = judge(sizing)
    if plot is not None:
        from rig.ui.plots import picture_file  # matplotlib is slow to import
        from rig.ui.plots.screw_chart import draw_region

        picture_file.save(draw_region(sizing.axis, result.found, result.judged), plot)
    if experiment is not None:
        check_folder("--experiment", experiment)
        experiment.write_text(experiment_text(result))
    if as_json:
        print_json(document(result))
    else:
        print_tables(result, every, published)
        print_written(plot, experiment)
    return 0 if result.admissible else REFUSED


def _read(file: Path | None, example: str | None) -> Sizing:
    """Read the sizing of a file or of a worked example; raises ConfigError."""
    if file is not None and example is not None:
        raise ConfigError(
            f"--example {example} with file '{file}'; must be one of the two: omit one"
        )
    if file is not None:
        return sizing_of(read_toml(file, "sizing"))
    if example is not None:
        return sizing_of(example_tables(example))
    raise ConfigError(
        f"SPEC.toml: missing; must be given: name a file, or try --example {EXAMPLES[0]}"
    )
