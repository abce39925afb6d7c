# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the curves of r4 plot. Standard input: a line of JSON, then little-endian doubles: for each
curve all times (seconds since the beginning), then all values. Standard output: the picture.

{"title": …, "format": "svg", "seconds": 12.5,
 "curves": [{"label": …, "unit": …, "count": …}],
 "spans": [{"label": "safe: stop", "reason": 2, "from": 1.0, "to": 2.5}],     reason -1: the board was silent
 "step": 1.0}                             a longer time without a value interrupts a curve

Exit code 3: matplotlib is not installed.
"""
import json
import sys

try:
    import matplotlib
    matplotlib.use('Agg')
    import numpy
    from matplotlib import pyplot
except ImportError:
    sys.exit(3)

# By reason: link, stop, handle, proximity, watchdog, fault; -1: no datagram.
COLOURS = {1: '#ffe08a', 2: '#f4a6a0', 3: '#f7c59f', 4: '#cdb4db', 5: '#a8c5da', 6: '#e78ac3', -1: '#d9d9d9'}


def broken(times, values, longest):
    """Inserts NaN into each gap, so that no line is drawn across it."""
    gaps = numpy.flatnonzero(numpy.diff(times) > longest) + 1
    return numpy.insert(times, gaps, numpy.nan), numpy.insert(values, gaps, numpy.nan)


def main():
    data = sys.stdin.buffer
    plan = json.loads(data.readline())
    matplotlib.rcParams.update({'svg.fonttype': 'none', 'svg.hashsalt': 'r4', 'agg.path.chunksize': 20000})
    if 'text.parse_math' in matplotlib.rcParams:  # show a dollar sign in a name unchanged
        matplotlib.rcParams['text.parse_math'] = False
    units = list(dict.fromkeys(curve['unit'] for curve in plan['curves']))
    figure, axes = pyplot.subplots(len(units), sharex=True, squeeze=False, layout='constrained',
                                   figsize=(10, 1.2 + 2.4 * len(units)))
    axes = dict(zip(units, axes[:, 0]))
    for curve in plan['curves']:
        times, values = numpy.frombuffer(data.read(16 * curve['count']), '<f8').reshape(2, -1)
        alone = curve['count'] == 1
        axes[curve['unit']].plot(*broken(times, values, plan['step']), linewidth=1, label=curve['label'],
                                 gid=curve['label'], marker='.' if alone else '')
    for unit, axis in axes.items():
        labelled = set()
        for index, span in enumerate(plan['spans']):
            silent = span['reason'] == -1
            axis.axvspan(span['from'], span['to'], facecolor=COLOURS.get(span['reason'], '#f4a6a0'), alpha=0.5,
                         linewidth=0, hatch='//' if silent else None, edgecolor='#aaaaaa', zorder=0,
                         gid=f'span {index}', label=None if span['label'] in labelled else span['label'])
            labelled.add(span['label'])
        axis.set_ylabel(unit)
        axis.grid(alpha=0.3)
        axis.legend(loc='upper left', bbox_to_anchor=(1.0, 1.0), fontsize='small', frameon=False)
    last = axes[units[-1]]
    last.set_xlabel('seconds')
    last.set_xlim(0, plan['seconds'] or 1)
    figure.suptitle(plan['title'], fontsize='medium')
    metadata = {'Date': None} if plan['format'] == 'svg' else None
    figure.savefig(sys.stdout.buffer, format=plan['format'], dpi=150, metadata=metadata)


main()
