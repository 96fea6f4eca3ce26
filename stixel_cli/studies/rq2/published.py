"""RQ2: what others published for lidar, quoted, and apart from what was run here."""

from stixel_cli.studies.nouns import Paragraph, Section, Table

_BEFORE = (
    ("Wahlström & Özkan 2015, as in model.md", "car, one side", "0.56–0.62", "8", "0.62–0.65"),
    ("Wahlström & Özkan 2015, as in model.md", "cyclist, one side", "0.38", "14", "0.48–0.50"),
    ("Wahlström & Özkan 2015, as in model.md", "car, whole contour", "0.48", "7", "0.938"),
    ("Wahlström & Özkan 2015, as in model.md", "pedestrian, whole contour", "0.10", "19", "0.918"),
    ("star-convex GP, heading tied (PyRecEst)", "car, one side", "0.61", "2.1", "0.607"),
    ("star-convex GP, heading tied (PyRecEst)", "cyclist, one side", "0.34", "2.1", "0.464"),
    ("star-convex GP, heading tied (PyRecEst)", "car, whole contour", "0.45", "3.3", "0.928"),
    (
        "star-convex GP, heading tied (PyRecEst)",
        "pedestrian, whole contour",
        "0.086",
        "3.9",
        "0.915",
    ),
    ("ellipse, multiplicative error (GM-MEM-EKF*)", "car, one side", "0.167", "2.7", "0.860"),
    ("ellipse, multiplicative error (GM-MEM-EKF*)", "cyclist, one side", "0.34", "27", "0.293"),
    ("random matrix for lidar rectangles", "car, one side", "0.56–0.59", "2–4", "0.38–0.45"),
    ("random matrix for lidar rectangles", "cyclist, one side", "0.14–0.16", "1–3", "0.46–0.53"),
)

_READ = (
    (
        "Wahlström & Özkan 2015, IEEE TSP 63(16)",
        "GP on the contour of a star-convex target, extended Kalman filter",
        "title, abstract and introduction; the authors' example code, which holds no result",
        "none: they hold no result",
    ),
    (
        "Kumru & Özkan 2021, IEEE TAES 57, arXiv:1909.11358",
        "the same in three dimensions, point clouds, simulated and real",
        "title and abstract",
        "none: they hold no result",
    ),
    (
        "Steuernagel, Thormann & Baum 2024, FUSION",
        "random matrix for rectangles on contour points; simulation with a real lidar's parameters",
        "abstract, and the published code, whose scripts draw the results but hold none",
        "none: they hold no result",
    ),
    (
        "Li, Chen, You & Qiu 2023, Scientific Reports 13, doi:10.1038/s41598-023-32236-w",
        "random matrix, modified for scans of a 2D lidar",
        "introduction",
        "none: it holds no result",
    ),
    (
        "Yurdakul, Çetinkaya, Çelebi & Özkan 2024, arXiv:2406.10389",
        "superellipses by a particle filter, contour points; simulated and real",
        "abstract and introduction",
        "none: they hold no result",
    ),
    (
        "Han, Kefferpütz & Beyerer 2025, arXiv:2503.10730",
        "extruded B-spline of a side view; lidar and radar, CARLA and recorded data",
        "abstract and introduction",
        "none: they hold no result",
    ),
    (
        "Steuernagel & Baum 2025, arXiv:2512.14426",
        "ellipse, its state parts decoupled; simulated, and recorded radar",
        "abstract",
        "none; radar, no lidar",
    ),
    (
        "Scheel & Dietmayer 2019, IEEE T-ITS 20(10)",
        "variational model of radar returns, many vehicles",
        "abstract and introduction",
        "none; radar, no lidar",
    ),
    (
        "Granström, Baum & Reuter, Extended Object Tracking: Introduction, Overview and "
        "Applications",
        "overview, with applications to lidar among others",
        "abstract and introduction",
        "none: they hold no result",
    ),
    (
        "Olsson, thesis (MDH): the work that this project goes back to",
        "the same filter on stixels",
        "text up to section 8.2.1",
        "none: the results are not in the text that could be read",
    ),
)


def published() -> Section:
    """The chapter; nothing in it was run by this study."""
    return Section(
        "Published for lidar",
        (
            Paragraph(
                "Nothing in this chapter was run by this study, and none of it can be set beside "
                "its tables number for number: scenes, targets, sensors and starts differ. A "
                "figure is quoted only if it was read in the source's own text. The comparison "
                "with a lidar that holds is the one above, of the same scenes and seeds."
            ),
            Table(
                "published_sources",
                "Work on extended targets with lidar (and what is nearest to it), what of each "
                "could be read when this page was written, and the figures quoted from there.",
                ("source", "method and set-up", "what could be read", "figures quoted"),
                _READ,
            ),
            Paragraph(
                "So no figure is quoted from these papers: their result sections could not be "
                "opened, and a number from memory is none. The thesis asks how its tracker does "
                "on stixels “compared to evaluations, previously done on LIDAR measurements” "
                "(section 2.3.2); its own figures for lidar are not in the text that could be "
                "read."
            ),
            Table(
                "measured_before",
                "Measured before the project began, other set-up (the project's model.md): public "
                "code of these methods on 60 scans at 10 Hz of a target that turns, 8 to 25 seeds, "
                "start at the truth with Gaussian noise, range noise 0.1 m (car) or 0.05 m "
                "(cyclist); “one side”: rays every 0.25°, first hit only, as a lidar sees it.",
                (
                    "tracker",
                    "target and what is seen",
                    "centre RMSE (m)",
                    "orientation RMSE (°)",
                    "mean IoU",
                ),
                _BEFORE,
            ),
        ),
    )
