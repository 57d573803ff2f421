/* Configuration of a server: defaults < file < environment < flags.
 *
 * The file is one JSON object with the keys below; the environment variable of a
 * key is PALPATE_ and the key in capitals (PALPATE_ALLOW_REMOTE=true); the flag is the key with dashes
 * (--allow-remote). An unknown key, an unknown PALPATE_ variable and a value out of range are errors that name their
 * source. Thread: [load]. */
#ifndef PAL_CLI_CONFIG_H
#define PAL_CLI_CONFIG_H
#include "server/base/flags.h"
#include "server/base/log.h"

enum { PAL_CONFIG_TEXT = 256, PAL_CONFIG_KEYS = 22 };

typedef struct pal_config {
    char listen[PAL_CONFIG_TEXT]; /* "127.0.0.1"                                                         */
    int port;                     /* 8090; 0: any free port                                              */
    bool allow_remote;            /* false: only loopback addresses may be listened on                   */
    char hosts[PAL_CONFIG_TEXT];  /* "a,b": names by which other machines reach it                      */
    char tls_cert[PAL_CONFIG_TEXT], tls_key[PAL_CONFIG_TEXT]; /* PEM files; "": no TLS              */
    char health[PAL_CONFIG_TEXT];      /* "9090", "0.0.0.0:9090"; "": on the main port                        */
    bool open;                         /* whoever connects is what it asks to be; false: by ticket           */
    char keys[PAL_CONFIG_TEXT];        /* key file of tickets; "": none                                      */
    char viewer[PAL_CONFIG_TEXT];      /* folder of the page's files; "": the one beside the program          */
    double error_m;                    /* bound of streamed positions; 0: 1/3000 of the box, at most 0.05 mm  */
    int max_clients;                   /* 200                                                                 */
    int max_viewers;                   /* 1000                                                                */
    char relays[PAL_CONFIG_TEXT];      /* "http://a:8092/,...": where who watches finds a place; "": none       */
    int threads;                       /* of a session whose scene gives none; 1                              */
    char lcm[PAL_CONFIG_TEXT];         /* LCM URL: start palpate-lcm with it; "": no LCM                      */
    char lcm_key[PAL_CONFIG_TEXT];     /* key file of that bus; "": none */
    char lcm_channel[PAL_CONFIG_TEXT]; /* prefix of the channels of that bus; "": PALPATE1 */
    char log[PAL_CONFIG_TEXT];         /* "error" | "warn" | "info" | "debug"; info                           */
    char record[PAL_CONFIG_TEXT];      /* write the input log there; "": do not                               */
    int agones;                        /* port of the Agones sidecar; 0: that of the environment, or none */
    char drain_to[PAL_CONFIG_TEXT];    /* "https://b.example/": where members go when the server ends; "": nowhere */
} pal_config;

/* a key, for manuals and checks: its name ("allow_remote"), value, range and help; out is unused */
extern const pal_flag pal_config_keys[PAL_CONFIG_KEYS];

void pal_config_default(pal_config *config);
/* reads a file over what is there; REFUSED names file and key, IO. All or nothing. */
pal_err pal_config_file(pal_config *config, const char *path, pal_diagnostic *diag);
/* the same from memory: name is used in messages */
pal_err pal_config_parse(pal_config *config, const char *name, const char *json, size_t n_byte, pal_diagnostic *diag);
/* every PALPATE_ variable of environ-like list (NULL-terminated "KEY=value" texts), but PALPATE_TICKET and PALPATE_CA,
 * which are of clients, and PALPATE_CONFIG, the file to read when there is no --config. All or nothing. */
pal_err pal_config_environment(pal_config *config, char *const *variable, pal_diagnostic *diag);
/* one key from text; where ("--port", "PALPATE_PORT") is used in messages */
pal_err pal_config_set(pal_config *config, const char *key, const char *text, const char *where, pal_diagnostic *diag);
pal_log_level pal_config_log_level(const pal_config *config);
/* pal_flags_parse with every key as a flag as well (allow_remote: --allow-remote), and --config FILE; on success the
 * struct holds defaults < file < environment < flags. 1: a refused file or environment */
int pal_config_parse_flags(const pal_flag_table *own, pal_config *config, int argc, char **argv,
                           pal_flag_common *common, const char **operand, int *n_operand);
#endif
