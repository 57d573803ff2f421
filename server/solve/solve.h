/* Solves a load case: surface -> voxel mesh -> world with model fem and solver static_newton -> displacements. [load]
 */
#ifndef PAL_SOLVE_SOLVE_H
#define PAL_SOLVE_SOLVE_H
#include "server/solve/load_case.h"
#include "server/solve/sample_points.h"

typedef struct pal_solve_options {
    const char *element; /* "hex8_bbar" | "hex8" | "tet4" | "tet10"                       */
    const char *law;     /* "linear" | "corotational" | "neo_hookean"                     */
    pal_case_voxel_options voxel;
    /* each voxel is solved as split^3 voxels of its fill, which separates the element error from the border's; 0: 1 */
    int split;
    bool hold_nodes; /* supports hold the nodes in them; false: of hexahedra with fill their surface
                        (surface_supports.h) */
    bool shares;  /* cut hexahedra have their inside spread evenly, as a live body has; false: Gauss weights integrate
                     over it */
    double twist; /* of hex8_bbar, linear or corotational (elements/elastic_hex.h); 0: PAL_SOLVE_TWIST */
    double tolerance;         /* of the residual, relative to the loads; 0: 1e-8 */
    int max_newton;           /* NUMERIC after this many Newton iterations; 0: 400 */
    const char *linear;       /* "direct" | "pcg"; NULL: chosen automatically */
    bool inertia_relief;      /* a body without supports: its inertia balances the loads; false: refused */
    double young_Pa, poisson; /* replace those of the problem's only material; NaN: unchanged */
    /* [load] Called between iterations. False stops with STATE. May be NULL. */
    bool (*progress)(const char *what, double fraction, void *user);
    void *user;
} pal_solve_options;

typedef struct pal_solve_result {
    int n_node, n_element, n_dof, n_newton, n_cg;
    int n_fixed; /* nodes that are held                                       */
    double residual;
    double prepare_s, assemble_s, factor_s, solve_s, total_s; /* solve_s: Newton without assembly and factorisation */
    double edge_m;                     /* voxel edge                                                */
    double volume_m3;                  /* of the material, by fill */
    double load_N[3];                  /* sum of all loads                                           */
    double area_m2[PAL_PROBLEM_LOADS]; /* area that each traction acts on */
    double reaction_N[3];              /* of the supports on the body; zero: free */
    double work_J;                     /* f . u                                                      */
    double energy_J;                   /* elastic                                                    */
    double max_m;                      /* largest displacement of a node                             */
    bool clamped;                      /* a Poisson ratio above 0.4999 was replaced by 0.4999 */
} pal_solve_result;

typedef struct pal_solution pal_solution; /* owns mesh and world */
/* Solves the load case. The result is filled as far as the solve went. Errors: NUMERIC: no convergence (diag gives
 * the progress); REFUSED (names entry and numbers): a load region that meets no surface, a point outside the body,
 * an empty support, no support, a point of no material; MEMORY. */
pal_err pal_solve(const pal_problem *problem, const pal_problem_case *load_case, const pal_surface *surface,
                  const pal_solve_options *options, pal_solution **out, pal_solve_result *result, pal_diagnostic *diag);
void pal_solution_free(pal_solution *solution); /* accepts NULL */
/* Displacement of the material point x (frame of the problem), by the shape functions of its element (or of the
 * nearest one, extrapolated). */
void pal_solution_at(const pal_solution *solution, const double x[3], double u[3]);
/* Legacy VTK (unstructured grid, displacement, von Mises stress) and CSV x,y,z,ux,uy,uz of all nodes. Errors: IO,
 * MEMORY. */
pal_err pal_solution_vtk(const pal_solution *solution, const char *path, pal_diagnostic *diag);
pal_err pal_solution_csv(const pal_solution *solution, const char *path, pal_diagnostic *diag);
#endif
