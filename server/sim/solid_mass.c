/* Mass matrices of subdivided solids. */
#include "server/sim/solid_mass.h"
