#!/bin/sh
# One volume with oblique axes as DICOM series, NIfTI, NRRD and MetaImage, written by pydicom, nibabel, dcm2niix and ITK: all
# become the same body at the same place. Prints "N passed, N failed, N skipped"; exit 1 when a check failed.
# usage: test_scans.sh PALPATE
set -u
palpate=$(realpath "$1")
here=$(realpath "$(dirname "$0")")
. "$here/shell.sh"
run() {
    timeout 100 "$palpate" "$@" >out 2>err </dev/null
    code=$?
}
# Debian's own Python, where another one stands before it
makes() { /usr/bin/python3 "$here/make_scans.py" "$@"; }
# the nodes of two bodies are within 3 micrometres: NIfTI has axes and quaternions in floats, and places of about 0.3 m
nodes_equal() {
    [ "$(lines "$1/ct.node")" -gt 1000 ] && [ "$(lines "$1/ct.node")" -eq "$(lines "$2/ct.node")" ] &&
        paste -d ' ' "$1/ct.node" "$2/ct.node" | awk 'NR > 1 { for (c = 2; c < 5; c++) {
            d = $c - $(c + 5); if (d > 3e-6 || d < -3e-6) exit 1 } }'
}
becomes() { # becomes FOLDER FILE [LOW]: the body of voxels above -200 HU
    run prepare "$2" -o "$1" --name ct --title ct --threshold "${3:--200},3000" --resolution 16
    check "exit code $code of $2" code_is 0
    [ -e "$1/ct.node" ] || mv "$1"/*.node "$1/ct.node"
}

begin "a folder without dcm2niix, or without DICOM, says so"
mkdir empty
PATH=$dir/empty "$palpate" prepare empty -o none >out 2>err </dev/null
code=$?
refused 1 'empty: a folder is read as DICOM by dcm2niix, which is not installed'
if command -v dcm2niix >/dev/null 2>&1; then
    run prepare empty -o none
    refused 1 'empty: dcm2niix finds no DICOM series in this folder'
fi
end

makes nifti ct.nii 2>/dev/null
if [ $? -ne 0 ]; then
    skip "scans of other tools" "pydicom or nibabel is not there (python3-pydicom, python3-nibabel)"
    finish
    exit
fi

begin "NIfTI with a qform alone, and MetaImage, have the axes of a sform"
becomes nifti ct.nii
makes qform ct.nii.gz
becomes qform ct.nii.gz
check "the body of the qform is elsewhere" nodes_equal nifti qform
makes meta ct.mha
becomes meta ct.mha
check "the body of MetaImage is elsewhere" nodes_equal nifti meta
run prepare ct.nii -o none --threshold 500,3000
refused 1 'ct.nii: no voxel is within 500 to 3000'
run prepare ct.nii -o none --threshold 3000,500
refused 2 '--threshold: is not LOW,HIGH'
end

if command -v plastimatch >/dev/null 2>&1; then
    begin "MetaImage of ITK, as 3D Slicer writes it, has the same body"
    timeout 100 plastimatch convert --input ct.nii --output-img itk.mha --output-type short >err 2>&1
    check "its axes are not oblique" grep -aq '^TransformMatrix = 0.9659.* -0.2588' itk.mha
    becomes itk itk.mha
    check "the body is elsewhere" nodes_equal nifti itk
    # ITK reads what we hold for the specification
    timeout 100 plastimatch convert --input ct.mha --output-img again.mha --output-type short >err 2>&1
    becomes again again.mha
    check "ITK reads our file otherwise" nodes_equal meta again
    end
else
    skip "MetaImage of ITK has the same body" "plastimatch is not there"
fi

if command -v dcm2niix >/dev/null 2>&1; then
    begin "a DICOM series has the body of the same NIfTI, whatever the folder is called"
    odd='-o x; $(touch told)'
    makes dicom "./$odd/ct" 7
    becomes dicom "./$odd/ct/"
    check "the body is elsewhere" nodes_equal nifti dicom
    check "no word of a name is carried out" no_such told
    # every Hounsfield unit has as many voxels
    run prepare ct.nii --list-labels --json
    sed -E 's/"volume_m3":[^}]*//g' out >nifti_values
    run prepare "./$odd/ct" --list-labels --json
    sed -E 's/"volume_m3":[^}]*//g' out >dicom_values
    check "other values" same nifti_values dicom_values
    run prepare "./$odd/ct" -o none
    refused 1 'ct: is no segmentation, its voxels have 64 values or more: --threshold LOW,HIGH'
    makes dicom "./$odd/ct" 8
    run prepare "./$odd/ct" -o none --threshold -200,3000
    refused 1 'ct: holds 2 volumes, of series 7, 8: put one into a folder of its own'
    rm -f "./$odd"/ct/8_*
    check "a temporary folder is left" [ -z "$(ls -d "${TMPDIR:-/tmp}"/palpate-dicom-* 2>/dev/null)" ]
    end

    begin "NRRD of dcm2niix has the same body"
    dcm2niix -g i -e y -b n -z n -f series -o . "$dir/$odd/ct" >err 2>&1
    # it has the stored values, which are 1024 above Hounsfield units
    becomes nrrd series.nrrd 824
    check "the body is elsewhere" nodes_equal nifti nrrd
    end
else
    skip "a DICOM series has the body of the same NIfTI" "dcm2niix is not there"
fi

finish
