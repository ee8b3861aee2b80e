"""Results of the benchmark as JUnit XML, which a CI shows as test cases."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import msgspec

from rig.studies.vision.kit import SceneResult


def write_junit(path: Path, results: Sequence[SceneResult]) -> None:
    """Write one test case for each result: tracker as class, scene as name; raises OSError."""
    suite = ElementTree.Element("testsuite", name="rig track --benchmark")
    for result in results:
        suite.append(_test_case(result))
    failed = [result for result in results if not result.passed]
    seconds = sum(result.seconds for result in results)
    counts = {"tests": len(results), "failures": len(failed), "errors": 0, "skipped": 0}
    for name, count in counts.items():
        suite.set(name, str(count))
    suite.set("time", f"{seconds:.6f}")
    root = ElementTree.Element("testsuites")
    root.append(suite)
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _test_case(result: SceneResult) -> ElementTree.Element:
    case = ElementTree.Element(
        "testcase", classname=result.tracker, name=result.scene, time=f"{result.seconds:.6f}"
    )
    if not result.passed:
        failure = ElementTree.SubElement(
            case, "failure", type="pass bar", message="; ".join(result.failures)
        )
        failure.text = "\n".join(result.failures)
    figures = msgspec.structs.asdict(result.score)
    lines = [f"{name} = {value:.6g}" for name, value in figures.items()]
    ElementTree.SubElement(case, "system-out").text = "\n".join(lines)
    return case
