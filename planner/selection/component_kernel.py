"""Connected components of some rows of a symmetric graph.

One plain function over arrays: the same source runs interpreted and compiled, with the types of
`component_kernel_compiled.pxd`. All numbers are rows or entries of the graph, far below 2**62.
"""

from __future__ import annotations

from typing import Any


def label_components(first: Any, to: Any, inside: Any, label: Any, stack: Any) -> None:
    """Number the connected components of the rows that are inside, from that of the lowest row on.

    Parameters
    ----------
    first, to
        Links of row a: `to[first[a]]` to `to[first[a + 1] - 1]`; each link is at both of its rows.
    inside
        1 for each row that counts, else 0 (rows,).
    label
        -1 for each row; receives the number of its component (rows,).
    stack
        Scratch (rows,).
    """
    components = 0
    for row in range(len(inside)):
        if inside[row] == 0 or label[row] >= 0:
            continue
        label[row], stack[0] = components, row
        size = 1
        while size > 0:
            size -= 1
            here = stack[size]
            for link in range(first[here], first[here + 1]):
                there = to[link]
                if inside[there] == 1 and label[there] < 0:
                    label[there], stack[size] = components, there
                    size += 1
        components += 1
