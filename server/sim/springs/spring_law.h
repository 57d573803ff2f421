/* Constants of paper B's springs from an isotropic material, and the part that the three spring rows share.
 *
 * A scene that gives k_J gives every spring of the row that constant, as the paper does. Otherwise spring i gets
 * k_i = factor E V_i l_i^2/h^2: V_i the volume of the tetrahedra around it (of cut voxels: what is inside, body->fill),
 * l_i^2 the mean square of its edges' lengths (volume springs: V_i alone). Constants that are given take the same
 * weights V_i l_i^2/h^5 when the scene asks for them, and derived ones none when it asks for that. With these weights
 * the five-tetrahedra lattice is exactly isotropic, which equal constants cannot make it (their shear modulus along the
 * grid is 0.4 of that across), and springs on the boundary count for the volume they have, so that thin bodies are not
 * too stiff. Moduli of the lattice, per E, derived by summing the springs of a periodic cell:
 *   shear  G = 2/3 f_d + 4/9 f_a        bulk  K = 10/9 f_d + 80/27 f_a + f_v
 * f_a takes half of the bulk modulus that edges alone lack (they have K = 5/3 G, nu = 0.25), at most half of the shear
 * modulus; f_v the rest. A body without area springs takes f_a = 0: the same moduli from two rows. A Poisson ratio
 * below 0.26 is simulated as 0.26.
 *
 * Regions of other materials (definition.h): every tetrahedron counts in V_i by factor E of its own material over those
 * of the body, at its centre; with equal weights the mean of that over the spring's tetrahedra stands. That is for
 * constants that are derived; those that are given stand for all materials, as they do when the material is edited.
 *
 * Constants on a grid (paper B 3.5): k_i is the weight times the mean over the spring's corners of the grid's value
 * there. Thread: [load], pal_spring_material [sim]. */
#ifndef PAL_SIM_SPRINGS_SPRING_LAW_H
#define PAL_SIM_SPRINGS_SPRING_LAW_H
#include "server/sim/core/effect.h"

typedef enum pal_spring_kind { PAL_SPRING_DISTANCE, PAL_SPRING_AREA, PAL_SPRING_VOLUME } pal_spring_kind;

/* constants of one row of springs: E_i = q_i k/2 C^2, f = -q_i (k C + c dC/dt) grad C with the dimensionless
 * constraint C; q_i = 1 or V_i l_i^2/h^5 (by_volume), times the spring's own constant when there is a grid: k_J is 1 */
typedef struct pal_spring {
    pal_spring_kind kind;
    double k_J, c_Js;
    bool given;        /* k_J or a grid stands in the scene: a material edit leaves it */
    bool by_volume;    /* q_i = V_i l_i^2/h^5                                          */
    bool on_grid;      /* constants from the body's grid                               */
    bool without_area; /* the body has no area springs: the others bear their share   */
} pal_spring;

/* the factors f_d, f_a, f_v above for a Poisson ratio; all positive */
void pal_spring_factors(double poisson, bool without_area, double factor[3]);
/* keys k_J (absent: the grid's, else derived), c_Js (0; on a grid: of a spring with the row's mean constant, the others
 * in proportion), weights ("equal" | "volume"; absent: equal when the constants are given), without_area (false); no
 * other key is allowed. REFUSED: k_J beside a grid that gives the same */
pal_err pal_spring_read(pal_spring_kind kind, pal_config_entry *item, const pal_build *build, pal_spring *out);
/* the weights q_i of springs between the corners item [n_item][n_corner] -> out [n_item]; share [n_tet]: times what
 * each tetrahedron counts, NULL: all are of one material; MEMORY */
pal_err pal_spring_weights(const pal_spring *spring, const pal_body *body, const double *share, const int32_t *item,
                           int n_item, int n_corner, double *out);
/* weights times the constants of the springs on the grid (nothing without one); c_Js is made to go with them */
void pal_spring_on_grid(pal_spring *spring, const pal_spring_grid *grid, const pal_body *body, const int32_t *item,
                        int n_item, int n_corner, double *weight);
/* constants at the body's nodes, J [n_node], before weights: a row's grid */
void pal_spring_nodes(const pal_spring_grid *grid, pal_spring_kind kind, const pal_body *body, double *out_J);
/* of all tetrahedra, of cut voxels what is inside */
double pal_spring_volume_m3(const pal_body *body);
void pal_spring_material(pal_spring *spring, const pal_body *body, const pal_material *material);
#endif
