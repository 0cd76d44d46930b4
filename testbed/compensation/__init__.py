"""Temperature drift of a fibre-optic gyro: the parts and the pipeline of paper 3, and a model that is trained on other
cycles, frozen, and sees temperature only.
"""

# How each method of a trained model is fitted.
FITS = {
    "gradient": "testbed.compensation.training:fit_coloured",
    "lssvm": "testbed.compensation.training:fit_lssvm",
    "polynomial": "testbed.compensation.training:fit_polynomial",
    "process": "testbed.compensation.training:fit_process",
}
# What stands in the place of a trained model and works on the record that it corrects: the paper's own protocol, and
# the methods that its Table 2 compares it with.
LITERATURE = {
    "paper3": "testbed.compensation.paper3:corrected",
    "akf22": "testbed.compensation.rivals:akf22",
    "olmd_kpca": "testbed.compensation.rivals:olmd_kpca",
    "ceemdan_lwt": "testbed.compensation.rivals:ceemdan_lwt",
}
