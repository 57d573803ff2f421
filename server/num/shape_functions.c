/* Shape functions and Gauss points.
 *
 * hex8: N_c = (1 + a x)(1 + b y)(1 + c z) / 8 with the corner's signs a, b, c. tet10: N_c = l_c (2 l_c - 1), middles
 * 4 l_a l_b. Gauss tables: hexahedron (1 / sqrt 3)^3; tetrahedron of degree 2 (Hammer and Stroud 1956), a = (5 + 3 sqrt
 * 5) / 20, b = (5 - sqrt 5) / 20; triangle of degree 4 with 6 points (Dunavant 1985). */
#include "server/num/shape_functions.h"

#include <stddef.h>

#define G 0.57735026918962576451
#define A 0.58541019662496845446
#define B 0.13819660112501051518

const int pal_tet10_edge[6][2] = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}};
const double pal_hex_gauss[8][3] = {{-G, -G, -G}, {G, -G, -G}, {-G, G, -G}, {G, G, -G},
                                    {-G, -G, G},  {G, -G, G},  {-G, G, G},  {G, G, G}};
const double pal_tet_gauss[4][4] = {{A, B, B, B}, {B, A, B, B}, {B, B, A, B}, {B, B, B, A}};
const double pal_tri_gauss[6][4] = {
    {0.10810301816807022736, 0.44594849091596488632, 0.44594849091596488632, 0.22338158967801146570},
    {0.44594849091596488632, 0.10810301816807022736, 0.44594849091596488632, 0.22338158967801146570},
    {0.44594849091596488632, 0.44594849091596488632, 0.10810301816807022736, 0.22338158967801146570},
    {0.81684757298045851308, 0.09157621350977074346, 0.09157621350977074346, 0.10995174365532186764},
    {0.09157621350977074346, 0.81684757298045851308, 0.09157621350977074346, 0.10995174365532186764},
    {0.09157621350977074346, 0.09157621350977074346, 0.81684757298045851308, 0.10995174365532186764}};

void pal_hex_shape(const double x[3], double n[8], double g[8][3])
{
    for (int c = 0; c < 8; c++) {
        double a = c & 1 ? 1 : -1, b = c & 2 ? 1 : -1, d = c & 4 ? 1 : -1;
        double p = 1 + a * x[0], q = 1 + b * x[1], r = 1 + d * x[2];
        if (n) n[c] = p * q * r / 8;
        if (!g) continue;
        g[c][0] = a * q * r / 8;
        g[c][1] = b * p * r / 8;
        g[c][2] = d * p * q / 8;
    }
}

void pal_tet10_shape(const double l[4], double n[10], double g[10][3])
{
    /* dl0 = -1 in every direction */
    static const double dl[4][3] = {{-1, -1, -1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int c = 0; c < 4; c++) {
        if (n) n[c] = l[c] * (2 * l[c] - 1);
        if (!g) continue;
        for (int k = 0; k < 3; k++) g[c][k] = (4 * l[c] - 1) * dl[c][k];
    }
    for (int e = 0; e < 6; e++) {
        int a = pal_tet10_edge[e][0], b = pal_tet10_edge[e][1];
        if (n) n[4 + e] = 4 * l[a] * l[b];
        if (!g) continue;
        for (int k = 0; k < 3; k++) g[4 + e][k] = 4 * (l[a] * dl[b][k] + l[b] * dl[a][k]);
    }
}

void pal_element_shape(int n_corner, const double local[4], double *n)
{
    if (n_corner == PAL_HEX_CORNERS)
        pal_hex_shape(local, n, NULL);
    else if (n_corner == PAL_TET10_CORNERS)
        pal_tet10_shape(local, n, NULL);
    else
        for (int k = 0; k < PAL_TET_CORNERS; k++) n[k] = local[k];
}
