"""Connected components of some rows of a symmetric graph: all of them, or those around some rows.

Plain functions over arrays: the same source runs interpreted and compiled, with the types of
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


def find_neighbours(first: Any, to: Any, rows: Any, is_end: Any, found: Any) -> int:
    """Find the rows that have a link to one of the `rows`, and return their number; links are as above.

    `found` receives them, once each (rows,). `is_end` is 0 for all rows, and again afterwards.
    """
    count = 0
    for k in range(len(rows)):
        for link in range(first[rows[k]], first[rows[k] + 1]):
            if is_end[to[link]] == 0:
                is_end[to[link]] = 1
                found[count] = to[link]
                count += 1
    for k in range(count):
        is_end[found[k]] = 0
    return count


def grow_parts(
    first: Any, to: Any, inside: Any, seeds: Any, label: Any, parent: Any, head: Any, tail: Any,
    turn: Any, following: Any, met: Any,
) -> int:  # fmt: skip
    """Grow a part from each seed, by turns, until all but one are whole; return the number of rows met.

    Parts that meet become one. So the largest part is met only as far as the second largest one reaches,
    or until the parts have met.

    The arguments are as for `label_components`, and: `seeds` from which parts grow (n,); `label`, -1, which
    receives the part of each row met, and `met`, the rows met (rows,); `parent`, `head` and `tail`, which
    receive what each part became, and from and to which row it has yet to grow, or -1, and `turn`, scratch
    (n,); `following`, scratch, the next such row after each (rows,).
    """
    count = plant(inside, seeds, label, parent, head, tail, turn, following, met)
    growing, turns = count, count
    while growing > 1:
        parts, turns = turns, 0
        for k in range(parts):
            part = turn[k]
            if growing == 1 or parent[part] != part or head[part] < 0:
                continue
            turn[turns], here = part, head[part]
            turns += 1
            head[part] = following[here]
            for link in range(first[here], first[here + 1]):
                there = to[link]
                if label[there] >= 0:
                    if parent[label[there]] != part:
                        growing -= join(root(label[there], parent), part, parent, head, tail, following)
                elif inside[there] == 1:
                    label[there], met[count], following[there] = part, there, -1
                    append(part, there, there, head, tail, following)
                    count += 1
            growing -= head[part] < 0
    for k in range(count):
        label[met[k]] = root(label[met[k]], parent)
    return count


def plant(
    inside: Any, seeds: Any, label: Any, parent: Any, head: Any, tail: Any, turn: Any, following: Any,
    met: Any,
) -> int:  # fmt: skip
    """Begin a part with each seed that is inside; return their number."""
    parts = 0
    for k in range(len(seeds)):
        if inside[seeds[k]] == 1 and label[seeds[k]] < 0:
            label[seeds[k]], parent[parts], head[parts], tail[parts] = parts, parts, seeds[k], seeds[k]
            turn[parts], following[seeds[k]], met[parts] = parts, -1, seeds[k]
            parts += 1
    return parts


def join(other: int, part: int, parent: Any, head: Any, tail: Any, following: Any) -> int:
    """Let a part become one with another; return 1, or 0 if they are one already."""
    if other == part:
        return 0
    parent[other] = part
    if head[other] >= 0:
        append(part, head[other], tail[other], head, tail, following)
    return 1


def append(part: int, begin: int, end: int, head: Any, tail: Any, following: Any) -> None:
    """Append the rows from one to another to those from which a part has not grown yet."""
    if head[part] < 0:
        head[part] = begin
    else:
        following[tail[part]] = begin
    tail[part] = end


def root(part: int, parent: Any) -> int:
    """The part that a part has become."""
    while parent[part] != part:
        parent[part] = parent[parent[part]]
        part = parent[part]
    return part
