#include "server/net/transport/tls_files.h"

#include <errno.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <stdio.h>
#include <string.h>

pal_err pal_tls_files_check(const char *certificate, const char *key, pal_diagnostic *diag)
{
    FILE *file[2] = {fopen(certificate, "r"), fopen(key, "r")};
    X509 *x509 = file[0] ? PEM_read_X509(file[0], NULL, NULL, NULL) : NULL;
    EVP_PKEY *own = file[1] ? PEM_read_PrivateKey(file[1], NULL, NULL, (void *)"") : NULL;
    pal_err err = PAL_ERR_OK;
    if (!file[0] || !file[1])
        err = PAL_REFUSE(diag, "%s cannot be read: %s", file[0] ? key : certificate, strerror(errno));
    else if (!x509)
        err = PAL_REFUSE(diag, "%s holds no certificate in PEM", certificate);
    else if (!own)
        err = PAL_REFUSE(diag, "%s holds no key in PEM without a password", key);
    else if (!X509_check_private_key(x509, own))
        err = PAL_REFUSE(diag, "the key of %s is not that of the certificate %s", key, certificate);
    X509_free(x509);
    EVP_PKEY_free(own);
    for (int i = 0; i < 2; i++)
        if (file[i]) fclose(file[i]);
    return err;
}
