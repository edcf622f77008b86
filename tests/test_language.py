"""Plain words: no phrase that has to be decoded, no document that is not here, no equation or link that leads nowhere.

Prose is what people read: docstrings, comments and messages of the package, the examples, and the pages.
"""

from __future__ import annotations

import ast
import io
import itertools
import re
import tokenize
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest
from folders import ROOT

FOLDERS = ("python/mbrs", "rust/src", "tests", "examples", "benches", "docs")
KINDS = {".py", ".pyi", ".rs", ".md", ".toml", ".js"}
TEXTS = {*KINDS, ".rst", ".css", ".svg", ".json", ".cff", ".lock", ""}
THEORY = ROOT / "docs" / "theory.md"

# Documents, lists and marks that the repository does not hold; a reader cannot look them up.
ABSENT = {
    "a list of methods": r"\bMETHODS(?:\.md|\s+[a-e]\.\d)",
    "an interface document": r"\bAPI\.md\b",
    "a design document": r"\bDESIGN(?:\.md)?\b",
    "a review": r"\bREVIEW(?:_\w+)?\.md\b|\bREVIEW_[A-Z]+\b",
    "a recipe": r"\bRECIPES_[A-Z]+\b",
    "a list of defects": r"\bDEFECTS\b",
    "a list of programs": r"\b(?:PEERS|CRATES|SEEDS)\.md\b",
    "a folder beside the repository": r"\bshared/(?:peers|seeds|hooks)\b|(?<!\w)\.\./shared\b",
    "an issue": r"\b[Ii]ssues? \d+\b|\bthe issue\b",
    "a tag of evidence": r"\[S00\d\]",
    "a text that is not here": r"\b[Tt]he (?:text that we have|specification's|contract says)\b|in the text we have\b",
    "a folder of one machine": r"/work/(?!flow)\w+",
}

PATTERNS = {pattern: name for name, pattern in ABSENT.items()}

# Phrases and what to write in their place.
PHRASES = {
    r"\b(?:says?|tells?|said) so\b": "name what is said",
    r"\bthat is said\b": "name what is said, and where",
    r"\bwhat is left\b": "a noun: remainder, residual, spectral radius",
    r"\b(?:leaves?|left) over\b": "residual",
    r"(?<!\b[Tt]here )\b(?:is|are|was|were) no (?!(?:longer|more|less|larger|smaller|better|worse)\b)[a-z]": "is not a ...",
    r"\bfreedoms\b": "degrees of freedom",
    r"\bstands\b": "is, has, rests",
    r"\bdrown": "is lost in",
    r"\bnothing tells\b": "without notice",
    r"(?:^|(?<=[.!?;] ))Of (?!course\b)(?:a|an|all|each|the|two|its|these|those|one|what)\b": "begin with the subject",
    r"\bmakes it so\b": "name the cause",
    r"\bis a turn\b": "is a rotation",
    r"\binfinitely fast oscillations?\b": "spectral radius at infinite frequency",
    r"\bwhat rubbed\b": "findings",
    r"\bis a matter of choice\b": "is arbitrary",
    r"\bover so long a time\b": "over this time span",
    r"\bof an instant\b": "at one instant",
    r"\bis to be small\b": "objective",
    r"\bdoes not know something\b": "does not support",
    r"\bwhat (?:the|a) constraints leave\b": "constraint residuals",
    r"\bwhich no quantity\b": "check the units",
}


def files(*folders):
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in KINDS and "target" not in path.parts and path != Path(__file__).resolve():
                yield path
    yield from (ROOT / name for name in ("README.md", "CHANGELOG.md", "pyproject.toml") if "docs" in folders)


def every_text():
    """All that a reader of the repository can open: also scripts of CI, notes beside the code and styles of pages."""
    for folder in (*FOLDERS, ".ci"):
        for path in sorted((ROOT / folder).rglob("*")):
            hidden = any(part in ("target", "__pycache__") for part in path.parts)
            if path.suffix in TEXTS and path.is_file() and not hidden and path != Path(__file__).resolve():
                yield path
    yield from (path for path in sorted(ROOT.iterdir()) if path.suffix in TEXTS - {""} and path.is_file())
    yield from (ROOT / name for name in ("LICENSE", ".gitignore"))


def squeezed(text):
    """One line, without the marks of comments."""
    return re.sub(r"\s+", " ", re.sub(r"\n\s*(?://[/!]?|#:?)?[ \t]*", " ", text)).strip()


class Tree(NamedTuple):
    """What the syntax tree of a source holds, each with its line: literals, heads of docstrings, names of functions and classes."""

    literals: list[tuple[int, str]]
    heads: list[tuple[int, str]]
    names: list[tuple[int, str]]


@cache
def tree(source):
    found = Tree([], [], [])
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.literals.append((node.lineno, squeezed(node.value)))
        elif isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            line = getattr(node, "lineno", 1)
            found.heads.append((line, (ast.get_docstring(node) or "").partition("\n")[0]))
            if not isinstance(node, ast.Module):
                found.names.append((line, node.name))
    return found


def python_prose(source):
    """(line, text) of comments, docstrings and literals."""
    comment, last = [], -2
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            line = token.start[0]
            if line != last + 1 or not comment:
                if comment:
                    yield comment[0], squeezed(" ".join(comment[1:]))
                comment = [line]
            comment.append(token.string.lstrip("#:").strip())
            last = line
    if comment:
        yield comment[0], squeezed(" ".join(comment[1:]))
    yield from tree(source).literals


def page_prose(source):
    """(line, text) of paragraphs, without code and formulas."""
    blank = re.sub(r"```.*?```|\$\$.*?\$\$", lambda m: "\n" * m[0].count("\n"), source, flags=re.S)
    blank = re.sub(r"`[^`\n]*`|\$[^$\n]*\$", "x", blank)
    line = 1
    for paragraph in re.split(r"(\n\s*\n|\n(?=\s*[-|#]))", blank):
        yield line + len(paragraph) - len(paragraph.lstrip("\n")), squeezed(re.sub(r"^[\s\-|#>*]+", "", paragraph))
        line += paragraph.count("\n")


PROSE = {".py": python_prose, ".md": page_prose}


def found_in(texts, patterns):
    """(line, phrase, remedy) of every pattern in pieces of prose; one search for all of them leaves out most pieces."""
    some = re.compile("|".join(patterns))
    suspects = [(n, text) for n, text in texts if some.search(text)]
    return [(n, m[0], remedy) for n, text in suspects for p, remedy in patterns.items() for m in re.finditer(p, text)]


@cache
def read(path):
    return path.read_text(encoding="utf-8")


def report(path, entries):
    return "\n".join(f"{path.relative_to(ROOT)}:{n}: {phrase!r} -> {remedy}" for n, phrase, remedy in entries)


ALL = list(files(*FOLDERS))
READ_BY_USERS = [p for p in files("python/mbrs", "docs", "examples") if p.suffix in PROSE]


def test_no_phrase_that_has_to_be_decoded():
    found = [report(path, found_in(PROSE[path.suffix](read(path)), PHRASES)) for path in READ_BY_USERS]
    assert len(found) > 200 and not any(found), "\n" + "\n".join(filter(None, found))


# A docstring begins with a noun or a verb.
BEGINNING = re.compile(r"(?:What|How|Where|Which|Whether|Why|Of|Those|That)\b")


def clauses(source):
    """(line, first line) of docstrings that begin with a clause in the place of a noun."""
    yield from ((line, head) for line, head in tree(source).heads if BEGINNING.match(head))


def test_docstrings_begin_with_a_noun_or_a_verb():
    found = [(path, *c) for path in files("python/mbrs") if path.suffix == ".py" for c in clauses(read(path))]
    assert not found, "\n".join(f"{path.relative_to(ROOT)}:{n}: {head}" for path, n, head in found)
    assert list(clauses('def f():\n    """What it is."""\n')) == [(1, "What it is.")]


# A name is a noun for a thing and a verb for what is computed: none of these tells a reader what it names.
OBSCURE = {
    "translated", "while_long", "hindrance", "of_family", "member_of", "framed", "parted", "entered", "taken", "picked", "marched",
    "turned", "found", "asked", "abscissa", "readings", "guessed_start", "amplified",
}  # fmt: skip


def test_names_are_nouns_and_verbs():
    found = [(path, *n) for path in files("python/mbrs") if path.suffix == ".py" for n in tree(read(path)).names]
    wrong = [f"{path.relative_to(ROOT)}:{n}: {name}" for path, n, name in found if name.lower().strip("_") in OBSCURE]
    assert len(found) > 2000 and not wrong, "\n".join(wrong)


def test_no_document_that_is_not_here():
    found = []
    for path in every_text():
        lines = enumerate(read(path).splitlines(), 1)
        found.append(report(path, found_in(lines, PATTERNS)))
    assert len(found) > 1000 and not any(found), "\n" + "\n".join(filter(None, found))


@pytest.mark.parametrize(
    "text",
    [
        "METHODS.md",
        "see API.md",
        "DESIGN.md",
        "REVIEW_CORE.md",
        "RECIPES_LOOPS",
        "DEFECTS D9",
        "PEERS.md",
        "shared/peers/exudyn",
        "../shared/seeds",
        "issue 12",
        "/work/main",
    ],
)
def test_absent_documents_are_found(text):
    assert found_in([(1, text)], PATTERNS)


@pytest.mark.parametrize(
    "text", ["pip install '.[test,peers]'", "shared/ideas", "random seeds", "/workflow", "a designer"]
)
def test_other_words_are_no_documents(text):
    assert not found_in([(1, text)], PATTERNS)


# --- equations of docs/theory.md, and links -----

TAGS = re.findall(r"\\tag\{(\d+\.\d+)\}", read(THEORY))
CITED = re.compile(r"docs/theory\.md((?:,? (?:and |to |or )?\(\d+\.\d+\))+|,? section \d+)?")


def test_equations_are_numbered_in_order():
    numbers = [tuple(map(int, tag.split("."))) for tag in TAGS]
    assert len(set(TAGS)) == len(TAGS) > 100
    for before, after in itertools.pairwise(numbers):
        assert after in {(before[0], before[1] + 1), (before[0] + 1, 1)}, (before, after)
    sections = [int(n) for n in re.findall(r"^## (\d+) ", read(THEORY), re.M)]
    assert sections == sorted({n for n, _ in numbers})


def cited(text):
    """Citations in a file: (numbers, the whole)."""
    for found in CITED.finditer(squeezed(text)):
        yield re.findall(r"\d+\.\d+", found[1] or ""), found


def test_cited_equations_exist():
    count = 0
    for path in ALL:
        for numbers, found in cited(read(path)):
            count += len(numbers)
            assert set(numbers) <= set(TAGS), (path, found[0])
            # code says which equation; a page may point at the whole
            whole = path.suffix not in {".py", ".rs"} or path.stem == "test_reference_problems"
            assert found[1] or whole, (path, found.string[max(0, found.start() - 60) : found.end() + 20])
    assert count > 80


def test_equations_cited_on_the_page_exist():
    body = read(THEORY)
    cited_here = re.findall(r"(?<![\w)])\((\d{1,2}\.\d{1,2})\)", re.sub(r"\\tag\{.*?\}", "", body))
    assert len(cited_here) > 30 and set(cited_here) <= set(TAGS), set(cited_here) - set(TAGS)
    for page in (p for p in files("docs") if p.suffix == ".md" and p != THEORY):
        here = re.findall(r"theory\.md\)((?:,? (?:and |to )?\(\d+\.\d+\))+)", squeezed(read(page)))
        assert set(re.findall(r"\d+\.\d+", " ".join(here))) <= set(TAGS), page


def test_literature_is_listed_and_used():
    body, listed = re.sub(r"\$.*?\$", "", read(THEORY), flags=re.S).split("## Literature")
    keys = re.findall(r"^- \[(\w+)\] .+(?:19|20)\d\d.*$", listed, re.M)
    assert len(keys) == len(listed.strip().splitlines()) and keys == sorted(keys, key=str.lower)
    used = set(re.findall(r"\[([A-Z]\w*)\](?!\()", body))
    assert used == set(keys)


def anchors(page):
    """Names of the headings of a page, as links write them."""
    heads = re.findall(r"^#+ (.+)$", read(page.resolve()), re.M)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def test_links_lead_somewhere():
    # pages in docs/generated and docs/gallery are made while the site is built, which checks links to them
    for path in ALL:
        text = read(path)
        for name in re.findall(r"(?<![\w/.])docs/(?!generated/|gallery/)[\w/-]+\.(?:md|png|svg)\b", text):
            assert (ROOT / name).exists(), (path, name)
        targets = (
            re.findall(r"\]\((?!https?:|mailto:|generated/|gallery/)([^)\s]+)\)", text) if path.suffix == ".md" else []
        )
        for target in targets:
            name, _, anchor = target.partition("#")
            page = (path.parent / name) if name else path
            assert page.exists(), (path, target)
            assert not anchor or page.suffix != ".md" or anchor in anchors(page), (path, target)


# --- the search itself -----


@pytest.mark.parametrize(
    "text",
    [
        "a warning says so",
        "What is left of it, and what is left.",
        "2 is no vector",
        "Ends. Of a pair the first",
        "Of all modes",
        "six freedoms",
        "it stands there",
    ],
)
def test_phrases_are_found(text):
    assert found_in([(1, text)], PHRASES)


@pytest.mark.parametrize(
    "text", ["there is no body 'a'", "is no longer there", "degrees of freedom", "one of a pair", "of all"]
)
def test_plain_words_are_left_alone(text):
    assert not found_in([(1, text)], PHRASES)


def test_prose_of_every_kind_is_seen():
    python = '"""Head: says\nso."""\nx = f"tells {x} so" + "say so"\n# a comment that says\n# so\n'
    assert [m for _, m, _ in found_in(python_prose(python), PHRASES)].count("says so") == 2
    assert found_in(python_prose('raise E(f"is no {x}: 2 is no vector")'), PHRASES)
    assert found_in(page_prose("text\n\nit says\nso here"), PHRASES) and not found_in(page_prose("`says so`"), PHRASES)
    assert next(cited("# docs/theory.md (1.2),\n# (1.3) to (1.4)"))[0] == ["1.2", "1.3", "1.4"]
