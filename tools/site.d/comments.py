#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Doxygen's input filter: converts the plain comments of a public header to Doxygen's. Usage: comments.py FILE

    // above a declaration             becomes     /// …
    declaration;  // after it                      ///< …, also on the lines that continue it
    // after the licence, about the file           /// \\file, then the text

Escapes markup, and expands the rows of board.def. The number of lines stays the same.
"""
import pathlib
import re
import subprocess
import sys

ALONE = re.compile(r'^(\s*)//\s?(.*)$')
BEHIND = re.compile(r'^(.*\S\s*)//\s(.*)$')
CODE = re.compile(r'(`[^`]*`)')
ROWS = re.compile(r'^(?:#define R4_\w+\((?:.*\\\n)*.*\n)+#include "[^"]*board\.def"\n', re.MULTILINE)
MARKUP = re.compile(r'([\\<>#@&%]|(?<!\w)::)')


def escaped(text):
    parts = CODE.split(text)
    return ''.join(part if part.startswith('`') else MARKUP.sub(r'\\\1', part) for part in parts)


def with_rows(path):
    def written_out(found):
        made = subprocess.run(['cpp', '-P', f'-I{path.parent}'], input=found[0], stdout=subprocess.PIPE, check=True, text=True)
        return '\n' * (found[0].count('\n') - 1) + ' '.join(made.stdout.split()) + '\n'
    return ROWS.sub(written_out, path.read_text('utf-8'))


def documented(lines):
    behind = None  # the column of a comment after a declaration, which the next line may continue
    for line in lines:
        alone = ALONE.match(line)
        if alone and 'SPDX' in line:
            yield r'/// \file'
        elif alone and 'NOLINT' not in line:
            goes_on = behind is not None and line.index('//') == behind
            yield f'{alone[1]}{"///<" if goes_on else "///"} {escaped(alone[2])}'
            continue
        else:
            found = BEHIND.match(line) if '"' not in line.split('//')[0] else None
            if found and not found[2].startswith('NOLINT') and re.search(r'[;,{}]\s*$|^\s*\w+\s*$', found[1]):
                behind = len(found[1])
                yield f'{found[1]}///< {escaped(found[2])}'
                continue
            yield line
        behind = None


def main():
    print('\n'.join(documented(with_rows(pathlib.Path(sys.argv[1])).split('\n'))))


if __name__ == '__main__':
    main()
