#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks the rules of plain English that a program can check. Usage: words.py TREE [--texts]

Faults: a comment of a C++ source over 100 columns; a question as a comment; "X is no Y"; a sentence of a comment or a
page whose subject is "Who ..." or "What ..."; a page that docs/README.md does not list. Prints the words of the prose
and the reading ease (Flesch: 60 and more is plain, below 30 is hard) of each page.

--texts: prints each text of a program that has two words or more, with its place, for a review.
"""
import pathlib
import re
import sys

ROOMS = ('include', 'protocol', 'transports', 'firmware', 'host', 'tools', 'tests', 'docs/examples', 'cmake')
COMMENT = {'.hpp': re.compile(r'(?:^|\s)//+ ?(.*)'), '.py': re.compile(r'(?:^|\s)# (.*)')}
COMMENT['.cpp'] = COMMENT['.hpp']
COMMENT['.txt'] = COMMENT['.cmake'] = COMMENT['.py']  # CMakeLists.txt
MOST_COLUMNS = 100
IS_NO = re.compile(r'\b(?!there\b)(\w+) (?:is|are) no\b(?! (?:longer|more|less)\b)', re.IGNORECASE)
WHO = re.compile(r'(?:^|[.:;] )(?:Who|Whoever|What|Whatever) (?!(?!.*[.]).*\?)[^?]*?(?:[.;]|$)')
TEXT = re.compile(r'"((?:[^"\\\n]|\\.)*)"|\'((?:[^\'\\\n]|\\.)*)\'')


def sources(root):
    for room in ROOMS:
        for path in sorted((root / room).rglob('*')):
            if path.suffix in COMMENT and 'node_modules' not in path.parts and path != pathlib.Path(__file__).resolve():
                yield path


def faults_of_text(text):
    """Yields the faults of one line of a comment or a page."""
    if IS_NO.search(text):
        yield '"is no": write "is not a"'
    if WHO.search(text):
        yield 'the subject is "Who" or "What": name the thing'


def faults_of_source(path):
    """Yields (line, reason). Comments of tests may be long, and may be questions."""
    product = 'tests' not in path.parts
    for number, line in enumerate(path.read_text(encoding='utf-8').splitlines(), 1):
        match = COMMENT[path.suffix].search(line)
        texts = [each for found in TEXT.findall(line) for each in found]
        comment = match[1] if match and not any(match[1] in each for each in texts) else ''
        for reason in (*faults_of_text(comment), *(each for text in texts for each in faults_of_text(text))):
            yield number, reason
        if product and path.suffix in ('.cpp', '.hpp') and comment and len(line) > MOST_COLUMNS:
            yield number, f'a comment of {len(line)} columns, {MOST_COLUMNS} at most'
        if product and comment.rstrip().endswith('?'):
            yield number, 'a question as a comment'


def prose_of(page):
    """The lines of a page outside of programs and their output, numbered."""
    inside = False
    for number, line in enumerate(page.read_text(encoding='utf-8').splitlines(), 1):
        if line.startswith('```'):
            inside = not inside
        elif not inside and not line.startswith('    '):
            yield number, line


def words_of(page):
    """The number of words in the prose of a page, without the addresses of links."""
    return sum(len([word for word in re.sub(r'\]\([^)]*\)', ']', line).split() if re.search('[A-Za-z]', word)])
               for _, line in prose_of(page))


def reading_ease(page):
    """Flesch's figure, from words per sentence and syllables per word."""
    text = ' '.join(re.sub(r'\]\([^)]*\)', ']', re.sub(r'`[^`]*`', 'x', line))
                    for _, line in prose_of(page) if not line.startswith(('|', '#')))
    sentences = max(1, len(re.findall(r'[.:;!?](?=\s|$)', text)))
    words = re.findall(r"[A-Za-z']+", text) or ['x']
    syllables = sum(max(1, len(re.findall('[aeiouy]+', re.sub('e$', '', word.lower())))) for word in words)
    return 206.8 - 1.015 * len(words) / sentences - 84.6 * syllables / len(words)


def print_texts(root):
    for path in sources(root):
        if 'tests' in path.relative_to(root).parts:
            continue
        for number, line in enumerate(path.read_text(encoding='utf-8').splitlines(), 1):
            if not line.lstrip().startswith(('#include', '//', '#')):
                for text in (each for found in TEXT.findall(line) for each in found if each.count(' ')):
                    print(f'{path.relative_to(root)}:{number}: {text}')


def main():
    root = pathlib.Path(sys.argv[1]).resolve()
    if sys.argv[2:] == ['--texts']:
        print_texts(root)
        return 0
    faults = [f'{path.relative_to(root)}:{line}: {reason}' for path in sources(root)
              for line, reason in faults_of_source(path)]
    index = (root / 'docs/README.md').read_text(encoding='utf-8')
    total = 0
    for page in [*sorted(root.glob('*.md')), *sorted((root / 'docs').rglob('*.md'))]:
        name = str(page.relative_to(root))
        faults += [f'{name}:{line}: {reason}' for line, text in prose_of(page)
                   for reason in faults_of_text(re.sub(r'`[^`]*`', 'x', text))]
        if page.parent.parent == root / 'docs' and f'({page.relative_to(root / "docs")}' not in index:
            faults.append(f'{name}: docs/README.md does not list it')
        words = words_of(page)
        total += words
        print(f'{words:6d} words, ease {reading_ease(page):3.0f}: {name}')
    print('\n'.join([*faults, f'{total} words, {len(faults)} faults']))
    return 1 if faults else 0


if __name__ == '__main__':
    sys.exit(main())
