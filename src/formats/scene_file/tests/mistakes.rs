//! Scene files that are wrong, and what is told of each.

use super::parsed;

/// What is written, and where and how it is told to be wrong: `line:column: message`.
const MISTAKES: &[(&str, &str)] = &[
    // Keys.
    (
        "x = 1",
        "1:1: unknown key `x` of a scene; accepted are `camera`, `film`, `background`, `ambient`, `light`, \
        `material`, `object`, `override`",
    ),
    (
        "[[light]]\nkind = \"point\"\nposition = [0, 0, 0]\n  colour = [1, 1, 1]",
        "4:3: unknown key `colour` of a light; did you mean `color`? accepted are `name`, `kind`, `color`, \
        `intensity`, `position`, `falloff`",
    ),
    (
        "[camera]\nviewpoint = [0, 0, 3]\neye = [0, 0, 1]",
        "3:1: unknown key `eye` of a camera; accepted are `name`, `kind`, `viewpoint`, `lower_left`, `lower_right`, \
        `upper_left`",
    ),
    (
        "[[object]]\nsphere = {}\nnormals = \"flat\"",
        "3:1: unknown key `normals` of an object; accepted are `sphere`, `name`, `material`, `transform`, `instances`, `visible`",
    ),
    ("[camera]\neye = [0, 0, 1]", "1:1: a camera needs `target`"),
    (
        "[camera]\neye = [0, 0, 1]\ntarget = [0, 0, 0]\nturntable = 5\npath = [{ frame = 1, eye = [0, 0, 2] }]",
        "5:8: the camera moves in two ways; give `turntable` or `path`",
    ),
    (
        "[camera]\neye = [0, 0, 1]\ntarget = [0, 0, 0]\npath = [{ frame = 2, eye = [0, 0, 2] }, { frame = 2, eye = [0, 0, 3] }]",
        "4:51: the keys of a camera's path must be in the order of their frames",
    ),
    (
        "[camera]\neye = [0, 0, 1]\ntarget = [0, 0, 0]\npath = [{ frame = 1.5, eye = [0, 0, 2] }]",
        "4:19: `frame` must be a whole number",
    ),
    (
        "[camera]\neye = [0, 0, 1]\ntarget = [0, 0, 0]\npath = [{ frame = 1, eye = [0, 0, 2], height = 3 }]",
        "4:39: unknown key `height` of a key of the camera's path; accepted are `frame`, `eye`, `target`, `fov`",
    ),
    (
        "[camera]\neye = [0, 0, 1]\ntarget = [0, 0, 0]\npath = []",
        "4:8: the camera's path has no keys; give some, or leave `path` out",
    ),
    (
        "[camera]\neye = [0, 0, 1]\ntarget = [0, 0, 0]\nturntable = 0",
        "4:13: `turntable` must be a whole number from 1 to 1000000, not 0",
    ),
    ("\n\n[[light]]\nposition = [0, 0, 0]", "3:1: a light needs `kind`"),
    ("[[material]]\ndiffuse = [1, 1, 1]", "1:1: a material needs `name`"),
    // TOML itself.
    ("[camera\n", "1:8: unclosed table, expected `]`"),
    ("[film]\nwidth = 1\nwidth = 2", "3:1: duplicate key"),
    ("camera = 3", "1:10: `camera` must be a table, not 3"),
    // Numbers and words.
    ("[camera]\neye = [0, 0]\ntarget = [0, 0, 0]", "2:7: `eye` must be 3 numbers, not a list of 2"),
    ("[camera]\neye = [0, 0, \"a\"]\ntarget = [0, 0, 0]", "2:14: `eye` must be a number, not \"a\""),
    ("[camera]\neye = [0, 0, nan]\ntarget = [0, 0, 0]", "2:14: `eye` must be a number, not nan"),
    ("[camera]\neye = [0, inf, 0]\ntarget = [0, 0, 0]", "2:11: `eye` must be a number, not inf"),
    ("[film]\nwidth = 0", "2:9: `width` must be a whole number from 1 to 65536, not 0"),
    ("[film]\nsamples = 1.5", "2:11: `samples` must be a whole number from 1 to 1048576, not 1.5"),
    ("[film]\nmax_depth = 1001", "2:13: `max_depth` must be a whole number from 0 to 1000, not 1001"),
    ("[film]\nclamp = \"none\"", "2:9: `clamp` must be \"shade\" or \"output\", not \"none\""),
    (
        "[camera]\nkind = \"fisheye\"",
        "2:8: `kind` must be \"perspective\", \"orthographic\" or \"four_point\", not \"fisheye\"",
    ),
    ("ambient = \"#ff\"", "1:11: `ambient` must be a colour, as [r, g, b] in linear light or \"#rrggbb\", not \"#ff\""),
    ("ambient = [0.1, -0.1, 0]", "1:17: `ambient` must be a number, 0 or greater, not -0.1"),
    ("ambient = 1e39", "1:11: `ambient` must be a number below 3e38, not 1e39"),
    // Cameras, film and background.
    (
        "[camera]\neye = [0, 0, 1]\ntarget = [0, 0, 1]",
        "1:1: the camera's eye and target are the same point, or not finite",
    ),
    ("[camera]\neye = [0, 1, 0]\ntarget = [0, 0, 0]", "1:1: the camera's up vector points along its view, or is zero"),
    ("[camera]\nfov = 180\neye = [0, 0, 3]\ntarget = [0, 0, 1]", "2:7: `fov` must be less than 180 degrees"),
    (
        "[[camera]]\neye = [0, 0, 3]\ntarget = [0, 0, 1]\n[[camera]]\neye = [0, 0, 3]\ntarget = [0, 0, 1]",
        "1:1: a camera needs `name` where there are several",
    ),
    ("[film]\nsize = [1]", "2:8: `size` must be [width, height]"),
    ("[film]\nsize = [1, 2]\nheight = 3", "3:10: the film has its size twice; give `size`, or `width` and `height`"),
    (
        "[background]\ncolor = \"#fff\"\ntransparent = true",
        "3:15: the background is given twice; keep one of `color`, `gradient`, `image`, `transparent`",
    ),
    ("[background]\nintensity = 2", "2:13: `intensity` belongs to a background `image`"),
    // Lights.
    (
        "[[light]]\nkind = \"spot\"\nposition = [0, 0, 0]\ndirection = [0, 0, 1]\ninner_angle = 50",
        "5:15: `inner_angle` must not exceed `outer_angle`",
    ),
    (
        "[[light]]\nkind = \"spot\"\nposition = [0, 0, 1]\ntarget = [0, 0, 1]",
        "4:10: the spot's `target` is its `position`",
    ),
    ("[[light]]\nkind = \"directional\"\ndirection = [0, 0, 0]", "3:13: `direction` must be a direction, not zero"),
    // Materials.
    (
        "[[material]]\nname = \"a\"\nks = 0.6\nkt = 0.5",
        "4:6: `kr` + `kt` is 1.1 in a channel, more than 1 (`kr` is `ks` unless given)",
    ),
    (
        "[[material]]\nname = \"a\"\nopacity = 0.6\nkt = 0.5",
        "3:11: `opacity` and `kt` say the same; keep one: kt = 1 - opacity",
    ),
    ("[[material]]\nname = \"a\"\nopacity = 2", "3:11: `opacity` must not exceed 1"),
    (
        "[[material]]\nname = \"a\"\n[[material]]\nname = \"a\"",
        "4:8: a second material is called `a`; names must differ",
    ),
    (
        "[[material]]\nname = \"a\"\ntexture = \"no.png\"",
        "3:11: the file `no.png` is not there; paths are relative to the scene file",
    ),
    ("[[material]]\nname = \"a\"\ntexture = 3", "3:11: `texture` must be a file, a table or false"),
    ("[[override]]\nmaterial = \"a\"", "2:12: no imported material is called `a`; there are none"),
    // Objects.
    (
        "[[object]]\nname = \"a\"",
        "1:1: an object needs a shape; one of `mesh`, `builtin`, `sphere`, `ellipsoid`, `cylinder`, `cone`, `paraboloid`, \
        `hyperboloid_one_sheet`, `hyperboloid_two_sheets`, `saddle`, `plane`, `quadric`",
    ),
    (
        "[[object]]\nsphere = {}\nplane = {}",
        "3:9: the object has a second shape, `plane`; write it as an [[object]] of its own",
    ),
    (
        "[[material]]\nname = \"gold\"\n[[object]]\nsphere = {}\nmaterial = \"golt\"",
        "5:12: there is no [[material]] called `golt`; did you mean `gold`? accepted are `gold`",
    ),
    ("[[object]]\nmesh = \"no.obj\"", "2:8: the file `no.obj` is not there; paths are relative to the scene file"),
    ("[[object]]\nmesh = \".\"", "2:8: the file `.` is a folder; paths are relative to the scene file"),
    ("[[object]]\nsphere = { radius = -1 }", "2:21: `radius` must be a number greater than 0, not -1"),
    ("[[object]]\ncylinder = { base = [0, 0, 0], top = [0, 0, 0] }", "2:38: `base` and `top` are the same point"),
    ("[[object]]\nhyperboloid_one_sheet = { from = 2 , to = 1 }", "2:43: `to` must be greater than `from`"),
    ("[[object]]\nhyperboloid_two_sheets = { limit = 1 }", "2:36: `limit` must be greater than `height`"),
    ("[[object]]\nquadric = { coefficients = [1, 2] }", "2:28: `coefficients` must be 10 numbers, not a list of 2"),
    (
        "[[object]]\nquadric = { coefficients = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0] }",
        "2:11: all coefficients of the quadric are 0",
    ),
    ("[[object]]\nquadric = {}", "2:11: a quadric needs either `coefficients` or `matrix`"),
    (
        "[[object]]\nquadric = { coefficients = [1, 1, 1, 0, 0, 0, 0, 0, 0, -1], clip = { min = [0, 0, 0], max = [inf, 0, 0] } }",
        "2:68: the clip box is empty; `min` must be less than `max` along each axis",
    ),
    (
        "[[object]]\nhyperboloid_one_sheet = { height = 1e-300 }",
        "2:25: the shape `hyperboloid_one_sheet` is too small; sizes must lie between 2^-40 and 2^40",
    ),
    (
        "[[object]]\nsaddle = { half_size = 1e200 }",
        "2:10: the shape `saddle` reaches beyond 2^40; make it smaller, or move it nearer to the origin",
    ),
    (
        "[[object]]\nhyperboloid_two_sheets = { limit = 1e300 }",
        "2:26: the shape `hyperboloid_two_sheets` reaches beyond 2^40; make it smaller, or move it nearer to the origin",
    ),
    (
        "[[object]]\nsphere = { radius = 1e-200 }",
        "2:10: the shape `sphere` is too small; sizes must lie between 2^-40 and 2^40",
    ),
    (
        "[[object]]\nplane = { point = [0, -1e13, 0] }",
        "2:9: the shape `plane` reaches beyond 2^40; make it smaller, or move it nearer to the origin",
    ),
    // Transforms.
    (
        "[[object]]\nsphere = {}\ntransform = { scale = 1e60 }",
        "3:13: the object reaches beyond 2^40; make it smaller, or move it nearer to the origin",
    ),
    (
        "[[object]]\nsphere = {}\ninstances = [{ scale = 2 }, { translate = [0, 1e300, 0] }]",
        "3:29: the object reaches beyond 2^40; make it smaller, or move it nearer to the origin",
    ),
    (
        "[[object]]\nsphere = {}\ntransform = { scale = 0 }",
        "3:13: the transform is singular or not finite; scales must not be 0",
    ),
    (
        "[[object]]\nsphere = {}\ntransform = [{ scale = 2, translate = [0, 0, 0] }]",
        "3:14: a transform step has one of `translate`, `rotate`, `scale`, `matrix`; \
        write several steps as a list: [{ ... }, { ... }]",
    ),
    (
        "[[object]]\nsphere = {}\ntransform = { matrix = [1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] }",
        "3:24: the matrix is not affine: its last row must be 0, 0, 0, 1; \
        numbers are column by column, so that the translation is numbers 13 to 15",
    ),
    ("[[object]]\nsphere = {}\ninstances = []", "3:13: `instances` is empty; leave it out for a single object"),
];

#[test]
fn mistakes_are_told_with_line_column_and_what_is_accepted() {
    for (text, expected) in MISTAKES {
        let error = parsed(text).err().unwrap_or_else(|| panic!("accepted:\n{text}"));
        assert_eq!(error.to_string(), format!("s.toml:{expected}"), "\n{text}");
    }
}
