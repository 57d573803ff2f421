/* Load-case problems from files: JSON of format "palpate-reference-1" -> pal_problem. Lengths in m, forces in N,
 * stresses in Pa, densities in kg/m^3. Every key is checked; an unknown one is refused. R: required.
 *
 * {
 *   "format": "palpate-reference-1",                                                                                R
 *   "name": "cantilever",                                                                     (the file's name)
 *   "units": {"length": "m", "force": "N", "stress": "Pa", "density": "kg/m^3"}               (no others are taken)
 *   "surface": "surface.obj",                          OBJ, STL, PLY or OFF, beside the problem unless absolute     R
 *   "surface_unit": "m",                                        m, cm, mm, um or in, for the surface file alone (m)
 *   "materials": [{                                                                        1 to 8, later ones win   R
 *     "id": "all", "region": REGION,                                                                                R
 *     "E": 100000.0, "nu": 0.3,                 E > 0, -1 < nu < 0.5; nu above 0.4999 is computed with 0.4999       R
 *     "density": 1000.0                                                          kg/m^3; only gravity asks for it
 * (1000)
 *   }],
 *   "supports": [                                                 0 to 8; none: a body that is free                 R
 *     {"type": "fixed", "region": REGION},                                   all points inside stay where they are
 *     {"type": "moved", "region": REGION, "move": [0, 0, 0.001],            all points inside are displaced by move, m
 *      "surface_normal": [0, 0, 1]}           either: only the part of the surface in the region that faces this way
 *   ],
 *   "load_cases": [{"id": "tip", "loads": [                                                 1 to 16, of 1 to 8 loads R
 *     {"type": "dead_traction", "region": REGION,                 on the part of the surface inside the region ...
 *      "surface_normal": [1, 0, 0],                               ... whose outward normal is this one    (any normal)
 *      "traction": [0, 0, -100],                     Pa, per area at rest, direction kept; and/or the force itself:
 *      "total_force": [0, 0, -0.25],                 N, spread evenly. Both: they must agree with `area` if it is
 * there, and traction is taken
 *     {"type": "point", "point": [0.2, 0, 0], "force": [0, 0, -1]},          N, on the element around the point
 *     {"type": "gravity", "acceleration": [0, 0, -9.81]}                     m/s^2, on all material
 *   ]}],
 *   "references": [{                                                                                          0 to 16
 *     "id": "linear", "file": "u.csv", "load_case": "tip",               CSV x,y,z,ux,uy,uz beside the problem      R
 *     "kinematics": "linear" | "finite",                                                                            R
 *     "law": "hooke" | "neo-hookean" | "st-venant-kirchhoff" | "corotational",        hooke goes with linear only   R
 *     "E": 100000.0, "nu": 0.3,             in place of the material's; only in a problem of one material
 *     "estimated_error": {"rms": 1e-4, "max": 2e-4}                     of the reference, over its largest displacement
 *   }]
 * }
 * REGION: {"type": "all"}, or {"type": "box", "min": [..], "max": [..]}: every point inside, the border included.
 * For people only, checked for their kind and then left alone: `note` in any object, `geometry` (any object),
 * `undamped_natural_frequencies` [{nu, density, E, hz: [..]}], `area` of a traction, and of a reference `points`,
 * `mesh` {element, nodes, elements, coarser_nodes}, `max_displacement`, `work_f_dot_u`, `difference_two_finest`
 * {rms, max}, `order_used`.
 * An id is unique among load cases and references together, so that one word names either.
 *
 * Every refusal names file, entry and number. Thread: [load]. */
#ifndef PAL_SCENE_PROBLEM_FILE_H
#define PAL_SCENE_PROBLEM_FILE_H
#include "server/sim/core/problem.h"

/* at most 1 MiB of JSON. *out: heap, free(). IO, REFUSED, MEMORY */
pal_err pal_problem_read(const char *path, pal_problem **out, pal_diagnostic *diag);
/* folder: where relative file names are; name: in messages. No file is opened */
pal_err pal_problem_parse(const char *name, const char *json, size_t n_byte, const char *folder, pal_problem **out,
                          pal_diagnostic *diag);
/* the case or reference of a name; NULL: none. `--case ID` takes either: a reference names its load case */
const pal_problem_case *pal_problem_case_find(const pal_problem *problem, const char *id);
const pal_problem_reference *pal_problem_reference_find(const pal_problem *problem, const char *id);
/* REFUSED: "FILE: FLAG: there is no load case or reference ...", with those there are; id NULL: "FLAG is missing" */
pal_err pal_problem_refuse_case(const pal_problem *problem, const char *flag, const char *id, pal_diagnostic *diag);
#endif
