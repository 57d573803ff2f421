/* Constraints of paper B's springs between 2, 3 or 4 nodes: edge C = l w - 1 with w = 1/l0, face C = 2A w - 1 with w =
 * 1/(2 A0), tetrahedron C = 6V w - 1 with w = 1/(6 V0), V signed by the order of the corners; their gradients and
 * second derivatives, one spring at a time. Energies and damping of the components and the tangent of a static
 * equilibrium use them. A spring's force is -k C grad C, its stiffness k (grad C grad C' + C H). Thread: any. */
#ifndef PAL_SIM_SPRINGS_SPRING_CONSTRAINT_H
#define PAL_SIM_SPRINGS_SPRING_CONSTRAINT_H
#include "server/base/vec3.h"
#include "server/sim/core/simd_blocks.h"
#include "server/sim/springs/tuning.h"

#include <math.h>
#include <string.h>

typedef enum pal_spring_kind { PAL_SPRING_DISTANCE, PAL_SPRING_AREA, PAL_SPRING_VOLUME } pal_spring_kind;

/* C and its gradient at each corner, 1/m; only the kind's own corners are set */
typedef struct pal_constraint {
    double c, g[PAL_CORNERS][3];
} pal_constraint;

/* corners of a spring: 2, 3, 4 */
PAL_INLINE int pal_spring_corner_count(pal_spring_kind kind)
{
    return kind == PAL_SPRING_DISTANCE ? 2 : kind == PAL_SPRING_AREA ? 3 : 4;
}
/* edges, faces of a tetrahedron, and itself: 6, 4, 1 */
PAL_INLINE int pal_spring_sides(pal_spring_kind kind)
{
    return kind == PAL_SPRING_DISTANCE ? 6 : kind == PAL_SPRING_AREA ? 4 : 1;
}

/* edges of a face opposite its corners, in turn, and twice the area vector; edges of a tetrahedron from corner 0 */
PAL_INLINE void pal_spring_face_edges(const double *const x[PAL_CORNERS], double e[3][3], double n[3])
{
    for (int c = 0; c < 3; c++) pal_sub3(e[c], x[(c + 2) % 3], x[(c + 1) % 3]);
    pal_cross3(n, e[2], e[0]);
}
PAL_INLINE void pal_spring_tet_edges(const double *const x[PAL_CORNERS], double e[3][3])
{
    for (int c = 0; c < 3; c++) pal_sub3(e[c], x[c + 1], x[0]);
}

/* positions of a spring's n corners; what is beyond them repeats the first */
PAL_INLINE void pal_spring_points(const double *x, const int32_t *node, int n, const double *to[PAL_CORNERS])
{
    for (int c = 0; c < PAL_CORNERS; c++) to[c] = x + 3 * node[c < n ? c : 0];
}

/* the measure whose inverse at rest is w: l m, 2A m^2, 6V m^3 (signed) */
PAL_INLINE double pal_spring_measure(pal_spring_kind kind, const double *const x[PAL_CORNERS])
{
    double e[3][3], n[3];
    if (kind == PAL_SPRING_DISTANCE) return pal_dist3(x[0], x[1]);
    for (int c = 0; c < (kind == PAL_SPRING_AREA ? 2 : 3); c++) pal_sub3(e[c], x[c + 1], x[0]);
    if (kind == PAL_SPRING_AREA) {
        pal_cross3(n, e[0], e[1]);
        return pal_norm3(n);
    }
    pal_cross3(n, e[1], e[2]);
    return pal_dot3(e[0], n);
}

/* quality of a tetrahedron: 1 for a regular one, 0 for a flat one */
PAL_INLINE double pal_spring_tet_quality(const double *const x[PAL_CORNERS])
{
    double mean2 = 0;
    for (int a = 0; a < 4; a++)
        for (int b = 0; b < a; b++) mean2 += pow(pal_dist3(x[a], x[b]), 2) / 6;
    return mean2 > 0 ? sqrt(2) * fabs(pal_spring_measure(PAL_SPRING_VOLUME, x)) / (mean2 * sqrt(mean2)) : 0;
}

/* C and its gradient. An edge below 1e-9 of its length at rest, or a face below 1e-12 of its area, has no direction:
 * zero gradient */
PAL_INLINE void pal_spring_constraint(pal_spring_kind kind, const double *const x[PAL_CORNERS], double w,
                                      pal_constraint *out)
{
    double e[3][3], n[3];
    if (kind == PAL_SPRING_DISTANCE) {
        pal_sub3(n, x[1], x[0]);
        double l = pal_norm3(n), scale = l * w > 1e-9 ? w / l : 0;
        out->c = l * w - 1;
        pal_scale3(out->g[1], scale, n);
        pal_scale3(out->g[0], -scale, n);
    } else if (kind == PAL_SPRING_AREA) {
        pal_spring_face_edges(x, e, n);
        double size = pal_norm3(n), scale = size * w > 1e-12 ? w / size : 0;
        out->c = size * w - 1;
        for (int c = 0; c < 3; c++) {
            pal_cross3(out->g[c], n, e[c]);
            pal_scale3(out->g[c], scale, out->g[c]);
        }
    } else {
        pal_spring_tet_edges(x, e);
        for (int c = 0; c < 3; c++) pal_cross3(out->g[c + 1], e[(c + 1) % 3], e[(c + 2) % 3]);
        out->c = pal_dot3(e[0], out->g[1]) * w - 1;
        for (int d = 0; d < 3; d++) {
            for (int c = 1; c < 4; c++) out->g[c][d] *= w;
            out->g[0][d] = -(out->g[1][d] + out->g[2][d] + out->g[3][d]);
        }
    }
}

/* m = s [a]x: m b = s a x b */
PAL_INLINE void pal_spring_add_cross(double m[9], double s, const double a[3])
{
    m[0] = 0, m[1] = -s * a[2], m[2] = s * a[1];
    m[3] = s * a[2], m[4] = 0, m[5] = -s * a[0];
    m[6] = -s * a[1], m[7] = s * a[0], m[8] = 0;
}

/* Second derivative of C, 1/m2: h[a][b] is the 3x3 block of corners a, b, row-major; blocks beyond the kind's corners
 * are left as they are, edges and faces without direction get zeros. With the unit direction u of an edge, the unit
 * normal n of a face and its edges e_a opposite the corners, in turn:
 *   edge  H = +-w/l (I - u u')     face  H_ab = w (e_a.e_b/|2A| n n' +- [n]x)     tet  H_ab = +-w [edge from 0]x */
PAL_INLINE void pal_spring_constraint_hessian(pal_spring_kind kind, const double *const x[PAL_CORNERS], double w,
                                              double h[4][4][9])
{
    const int n_corner = pal_spring_corner_count(kind);
    double e[3][3], n[3];
    for (int a = 0; a < n_corner; a++)
        for (int b = 0; b < n_corner; b++) memset(h[a][b], 0, sizeof h[a][b]);
    if (kind == PAL_SPRING_DISTANCE) {
        pal_sub3(n, x[1], x[0]);
        double l = pal_norm3(n), s = l * w > 1e-9 ? w / l : 0;
        pal_scale3(n, s > 0 ? 1 / l : 0, n);
        for (int i = 0; i < 9; i++) {
            double block = s * ((i % 4 == 0 ? 1 : 0) - n[i / 3] * n[i % 3]);
            h[0][0][i] = h[1][1][i] = block;
            h[0][1][i] = h[1][0][i] = -block;
        }
    } else if (kind == PAL_SPRING_AREA) {
        pal_spring_face_edges(x, e, n);
        double size = pal_norm3(n), s = size * w > 1e-12 ? w / size : 0;
        if (!(s > 0)) return;
        pal_scale3(n, 1 / size, n);
        for (int a = 0; a < 3; a++) {
            pal_spring_add_cross(h[a][(a + 1) % 3], -w, n);
            pal_spring_add_cross(h[a][(a + 2) % 3], w, n);
            for (int b = 0; b < 3; b++)
                for (int i = 0; i < 9; i++) h[a][b][i] += s * pal_dot3(e[a], e[b]) * n[i / 3] * n[i % 3];
        }
    } else {
        pal_spring_tet_edges(x, e);
        for (int c = 0; c < 3; c++) {
            int next = (c + 1) % 3, last = (c + 2) % 3;
            pal_spring_add_cross(h[c + 1][next + 1], -w, e[last]);
            pal_spring_add_cross(h[c + 1][last + 1], w, e[next]);
        }
        for (int a = 1; a < 4; a++)
            for (int b = 1; b < 4; b++)
                for (int i = 0; i < 9; i++) h[a][0][i] -= h[a][b][i], h[0][b][i] -= h[a][b][i];
    }
}
#endif
