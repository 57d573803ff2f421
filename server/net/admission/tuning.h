/* Policy of admission. Each constant states its unit, its reason, and the test that bounds it. */
#ifndef PAL_NET_ADMISSION_TUNING_H
#define PAL_NET_ADMISSION_TUNING_H

/* ns: a member whose connection has ended may return with its ticket for so long: a station restarts (test_admission)
 */
#define PAL_RETURN_NS 60000000000u
#endif
