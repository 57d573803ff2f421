/* libdhd.so: functions of the DHD library over the fake plant. Nothing runs by itself: a command of force is one frame
 * of 1 ms. */
#include "tests/fakes/fake_plant.h"

#include <math.h>
#include <stddef.h>
#include <stdint.h>

#define EXPORT __attribute__((visibility("default")))
EXPORT int dhdGetDeviceCount(void);
EXPORT int dhdOpen(void);
EXPORT int dhdOpenID(char number);
EXPORT int dhdClose(char id);
EXPORT int dhdStop(char id);
EXPORT int dhdErrorGetLast(void);
EXPORT const char *dhdErrorGetStr(int code);
EXPORT int dhdGetSystemType(char id);
EXPORT const char *dhdGetSystemName(char id);
EXPORT int dhdEnableForce(unsigned char on, char id);
EXPORT int dhdSetGravityCompensation(int on, char id);
EXPORT int dhdGetStatus(int *status, char id);
EXPORT int dhdGetPosition(double *x, double *y, double *z, char id);
EXPORT int dhdGetOrientationFrame(double frame[3][3], char id);
EXPORT int dhdSetForce(double x, double y, double z, char id);
EXPORT int dhdSetForceAndTorque(double x, double y, double z, double tx, double ty, double tz, char id);
EXPORT unsigned dhdGetButtonMask(char id);
EXPORT int dhdGetGripperAngleRad(double *angle, char id);
EXPORT bool dhdHasWrist(char id);
EXPORT bool dhdHasActiveWrist(char id);
EXPORT bool dhdHasGripper(char id);
EXPORT int dhdEnableExpertMode(void);
EXPORT int dhdSetWatchdog(unsigned char n, char id);
EXPORT const fake_control *fake_entry(void);

static int last_error, enabled, expert, watchdog;

static int failed(int code)
{
    last_error = code;
    return -1;
}
/* -1: this call fails */
static int answer(char id)
{
    if (id != 0) return failed(15);
    if (fake_value(FAKE_UNPLUGGED)) return failed(2);
    if (fake_due(FAKE_ERROR_AT)) return failed((int)fake_value(FAKE_ERROR));
    return 0;
}

int dhdGetDeviceCount(void)
{
    fake_begin();
    return fake_value(FAKE_UNPLUGGED) ? 0 : 1;
}
int dhdOpen(void)
{
    fake_begin();
    expert = enabled = 0;
    if (fake_value(FAKE_UNPLUGGED)) return failed(5);
    return fake_value(FAKE_INIT) ? failed((int)fake_value(FAKE_INIT)) : 0;
}
int dhdOpenID(char number)
{
    return number == 0 ? dhdOpen() : failed(15);
}
int dhdClose(char id)
{
    return answer(id);
}
int dhdStop(char id)
{
    enabled = 0;
    return answer(id);
}
int dhdErrorGetLast(void)
{
    return last_error;
}
const char *dhdErrorGetStr(int code)
{
    return code == 2 ? "communication error" : code == 12 ? "device not ready" : "fake error";
}
int dhdGetSystemType(char id)
{
    (void)id;
    return 37;
}
const char *dhdGetSystemName(char id)
{
    (void)id;
    return "Fake omega.7";
}
int dhdEnableForce(unsigned char on, char id)
{
    enabled = on;
    return answer(id);
}
int dhdSetGravityCompensation(int on, char id)
{
    (void)on;
    return answer(id);
}
/* writes as many ints as its version has, into the caller's array */
int dhdGetStatus(int *status, char id)
{
    const int n = (int)fake_value(FAKE_STATUS);
    for (int i = 0; i < n; i++) status[i] = i == 5 ? enabled && !fake_value(FAKE_FORCE_OFF) : i;
    return answer(id);
}
static void nothing(void) {}
int dhdGetPosition(double *x, double *y, double *z, char id)
{
    double at[3];
    fake_wait(nothing, nothing);
    if (answer(id)) return -1;
    fake_read(at);
    *x = at[0], *y = at[1], *z = at[2];
    return 0;
}
/* 90 degrees about z: row by row, columns are the axes of the handle */
int dhdGetOrientationFrame(double frame[3][3], char id)
{
    static const double turned[3][3] = {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}};
    for (int i = 0; i < 9; i++) frame[i / 3][i % 3] = turned[i / 3][i % 3];
    return answer(id);
}
/* without a watchdog of the firmware the force would stay when the program hangs: that is an error here */
int dhdSetForce(double x, double y, double z, char id)
{
    const double written[3] = {x, y, z}, none[3] = {0, 0, 0};
    if (answer(id)) return -1;
    if (watchdog != 80) return failed(9);
    fake_step(1e-3, enabled && !fake_value(FAKE_FORCE_OFF) ? written : none, written);
    return fabs(x) + fabs(y) + fabs(z) > 12 ? 2 : 1; /* saturated; else called too soon: neither is an error */
}
int dhdSetForceAndTorque(double x, double y, double z, double tx, double ty, double tz, char id)
{
    (void)tx, (void)ty, (void)tz;
    return dhdSetForce(x, y, z, id);
}
unsigned dhdGetButtonMask(char id)
{
    (void)id;
    return (unsigned)fake_value(FAKE_BUTTONS);
}
int dhdGetGripperAngleRad(double *angle, char id)
{
    *angle = 0.25;
    return answer(id);
}
bool dhdHasWrist(char id)
{
    return id == 0;
}
bool dhdHasActiveWrist(char id)
{
    (void)id;
    return false;
}
bool dhdHasGripper(char id)
{
    return id == 0;
}
int dhdEnableExpertMode(void)
{
    return expert = 1, 0;
}
int dhdSetWatchdog(unsigned char n, char id)
{
    if (!expert) return failed(9);
    watchdog = n;
    return answer(id);
}

const fake_control *fake_entry(void)
{
    static const fake_control *control;
    if (!control) control = fake_common(NULL, NULL);
    return control;
}
