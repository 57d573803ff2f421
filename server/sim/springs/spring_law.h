/* Spring constants of paper B's springs from an isotropic material.
 *
 * A scene that gives k_J gives every spring of a kind that constant, as the paper does. Otherwise spring i receives
 * k_i = factor E V_i l_i^2/h^2: V_i the volume of the tetrahedra around it (of cut voxels the part inside, body->fill),
 * l_i^2 the mean square of its edges (volume springs: V_i alone). Given constants take the same weights V_i l_i^2/h^5
 * with weights "volume", derived ones none with "equal". With these weights the five-tetrahedra lattice is isotropic.
 * Moduli of the lattice, per E, by summation over a periodic cell:
 *
 *     shear G = 2/3 f_d + 4/9 f_a        bulk K = 10/9 f_d + 80/27 f_a + f_v
 *
 * f_a takes half of the bulk modulus that edges alone lack (they have K = 5/3 G, nu = 0.25), at most
 * half of the shear modulus; f_v takes the rest. A body without area springs has f_a = 0: the same moduli from two
 * kinds. Ratios below 0.26 are simulated as 0.26.
 *
 * Regions of other materials (definition.h): each tetrahedron counts in V_i by factor E of its material over those of
 * the body, at its centre; with equal weights, by their mean over the spring's tetrahedra. Given constants hold for all
 * materials, as they do in a live edit.
 *
 * Constants on a grid (paper B section 3.5): k_i is the weight times the mean over the spring's corners of the grid's
 * value there. Thread: [load], pal_spring_material [sim]. */
#ifndef PAL_SIM_SPRINGS_SPRING_LAW_H
#define PAL_SIM_SPRINGS_SPRING_LAW_H
#include "server/sim/core/effect.h"
#include "server/sim/springs/spring_constraint.h"

/* constants of one kind of springs: E_i = q_i k/2 C^2, f = -q_i (k C + c dC/dt) grad C with the dimensionless
 * constraint C; q_i is 1 or V_i l_i^2/h^5 (by_volume), times the spring's own constant with a grid, where k_J is 1 */
typedef struct pal_spring {
    pal_spring_kind kind;
    double k_J, c_Js;
    bool given;        /* k_J or a grid from the scene: a live edit leaves it           */
    bool by_volume;    /* q_i = V_i l_i^2/h^5                                          */
    bool on_grid;      /* constants from the body's grid                               */
    bool without_area; /* the body has no area springs: the others take their part     */
} pal_spring;

/* the factors f_d, f_a, f_v above for a Poisson ratio; all positive */
void pal_spring_factors(double poisson, bool without_area, double factor[3]);
/* Reads k_J (absent: the grid's, else derived), c_Js (0; on a grid: of a spring with the mean constant, the others in
 * proportion), weights ("equal" | "volume"; absent: equal when constants are given) and without_area (false). REFUSED:
 * any other key, k_J beside a grid that gives the same */
pal_err pal_spring_read(pal_spring_kind kind, pal_config_entry *item, const pal_build *build, pal_spring *out);
/* out [n_item] = weights q_i of springs with the corners item [n_item][n_corner]; share [n_tet]: factor of each
 * tetrahedron, NULL: 1; MEMORY */
pal_err pal_spring_weights(const pal_spring *spring, const pal_body *body, const double *share, const int32_t *item,
                           int n_item, int n_corner, double *out);
/* of_tet [n_tet][sides of the kind]: the springs between corners of each tetrahedron, -1: no such spring; MEMORY */
pal_err pal_spring_find_sides(const pal_tets *tets, const int32_t *item, int n_item, int n_corner, int32_t *of_tet);
/* weight *= constants from the grid (nothing without one), and c_Js follows from them */
void pal_spring_on_grid(pal_spring *spring, const pal_spring_grid *grid, const pal_body *body, const int32_t *item,
                        int n_item, int n_corner, double *weight);
/* out_J [n_node] = constants of the grid at the body's nodes, before weights */
void pal_spring_nodes(const pal_spring_grid *grid, pal_spring_kind kind, const pal_body *body, double *out_J);
/* volume of all tetrahedra, of cut voxels the part inside */
double pal_spring_volume_m3(const pal_body *body);
void pal_spring_material(pal_spring *spring, const pal_body *body, const pal_material *material);
#endif
