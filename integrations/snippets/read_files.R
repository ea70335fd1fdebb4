# Read what gp-labeler writes, in R, with jsonlite.
#   landmarks <- read_landmarks("GP01_L.mrk.json")   # N x 3 matrix, mm, LPS, named rows; NA where not placed
#   pose <- read_pose("pose.json")                   # origin (mm), axis, transform (4 x 4)
# An array of all animals, for Morpho::procSym or geomorph::gpagen:
#   simplify2array(lapply(Sys.glob("labelled/*_L.mrk.json"), read_landmarks))

read_landmarks <- function(file) {
  controls <- jsonlite::read_json(file)$markups[[1]]$controlPoints
  position <- function(p) if (identical(p$positionStatus, "defined")) as.numeric(unlist(p$position)) else rep(NA_real_, 3)
  points <- t(vapply(controls, position, numeric(3)))
  rownames(points) <- vapply(controls, function(p) p$label, "")
  points
}

read_pose <- function(file) {
  told <- jsonlite::read_json(file, simplifyVector = TRUE)
  list(origin = told$cochlea_origin_mm, axis = told$modiolar_axis, transform = told$transform)
}
