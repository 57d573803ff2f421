/* Libraries that are not there, or lack a function: one sentence that names them. Its own process, whose search path
 * has a libHD.so without hdStopScheduler and no DHD library. */
#include "clients/haptic_bridge/device_dhd.h"
#include "clients/haptic_bridge/device_hdapi.h"
#include "tests/check.h"

static void library_that_lacks_a_function_is_refused_by_its_name(void)
{
    char reason[256];
    void *device;
    pal_dev_info info;
    CHECK(pal_device_hdapi()->probe(reason, sizeof reason) < 0);
    CHECK_TEXT(reason, "libHD.so has no function hdStopScheduler: another version?");
    const int error = pal_device_hdapi()->open(&device, "", &info);
    CHECK(error < 0);
    CHECK_TEXT(pal_device_hdapi()->strerror(device, error), reason);
    pal_device_hdapi()->close(device);
}

static void missing_library_is_reported_with_what_was_looked_for(void)
{
    char reason[256];
    void *device;
    pal_dev_info info;
    CHECK(pal_device_dhd()->probe(reason, sizeof reason) < 0);
    CHECK_TEXT(reason,
               "looked for libdrd.so, libdrd.so.3, libdhd.so, libdhd.so.3, /usr/local/lib/libdrd.so: not there");
    CHECK(pal_device_dhd()->open(&device, "", &info) < 0);
    pal_device_dhd()->close(device);
}

int main(void)
{
    RUN(library_that_lacks_a_function_is_refused_by_its_name);
    RUN(missing_library_is_reported_with_what_was_looked_for);
    return check_report();
}
