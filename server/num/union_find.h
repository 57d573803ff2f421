/* Disjoint sets of the numbers 0 to n - 1 (union-find with path halving). The smallest number of a set is its root,
 * whatever the order of joins, so that roots precede their members. root [n] is memory of the caller. No memory, no
 * errors. Thread: [any], one at a time. */
#ifndef PAL_NUM_UNION_FIND_H
#define PAL_NUM_UNION_FIND_H
#include <stdint.h>

/* every number is a set of its own */
static inline void pal_union_find_init(int32_t *root, int n)
{
    for (int i = 0; i < n; i++) root[i] = i;
}

static inline int32_t pal_union_find_root(int32_t *root, int32_t i)
{
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
}

static inline void pal_union_find_join(int32_t *root, int32_t a, int32_t b)
{
    a = pal_union_find_root(root, a), b = pal_union_find_root(root, b);
    if (a < b)
        root[b] = a;
    else
        root[a] = b;
}

/* turns the forest into labels 0, 1, ... in the order of the roots; returns their number */
static inline int pal_union_find_label(int32_t *root, int n)
{
    int n_set = 0;
    for (int i = 0; i < n; i++) root[i] = pal_union_find_root(root, i);
    /* a root precedes its members, so it has its label when they need it */
    for (int i = 0; i < n; i++) root[i] = root[i] == i ? n_set++ : root[root[i]];
    return n_set;
}
#endif
