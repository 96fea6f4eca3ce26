"""What may be typed as a value: of every type, in every form of the grammar, and of none."""


def words(text: str) -> list[str]:
    """The words of a text, of which none has a space."""
    return text.split()


ODD = (
    "", " ", "\n", "\t", "\0", "\r\n", "\x1b[31m", "\x7f", "\u2028", "\u202e", "é", "中文",
    "\U0001f600", "\udcff", "a\udc80b", "\ufeff", "a\u0301", "--", "-", "---", "-1", "'", '"',
    "\\", "`", "$", "${", "${}", "%s", "{}", "{0}", "[red]x[/red]", "*", "?", "!", "#", ";",
    "|", "A" * 300, "é" * 5000, "9" * 5000, "[" * 2000, "(" * 2000, "a," * 2000, "a.b." * 500,
    "null", "x=" * 100,
)  # fmt: skip
NUMBERS = (
    *words("""
    0 1 -1 2 3.5 1e3 1e400 -1e400 1e-400 nan -nan inf -inf 0x10 1_000 00 -0 -0.0 1e308 true
    false True yes null None ~ 2**63 9223372036854775808 1. .5 +1 1e 0.1 100 64
"""),
    "9" * 20,
    "9" * 400,
)
LISTS = words("""
    [] {} [1] [1,2] [1,[2,[3]]] {a:1} {a:{b:[1]}} [[0,12],[3,15],[0,20]] [a] {1:2} [null]
    [nan,inf] {'':1} [,] [1,] {a} [1 1] [0,1e400] {seed:1}
""")
SWEEPS = words("""
    1,2 1,1 , 1, ,1 1,,2 choice() choice(1,2) choice(1) choice([1],[2]) range(3) range(0,3)
    range(0,1,0.1) range(3,0) range(0,3,0) range(0,1e9) range(0,1,1e-9) range(nan,1)
    range(0,inf) range(0,10,nan) range(1e400,2) range() range(start=0,stop=3,step=1) range(a,b)
    interval(0,1) interval(1,0) glob(*) glob([a*,b*]) glob(*,exclude=c*) glob() glob([)
    sort(2,1) sort(2,1,reverse=true) sort(range(0,3)) shuffle(1,2) shuffle(range(0,3))
    tag(a,1,2) tag(a,choice(1,2)) int(3.5) float(1) str(1) bool(x) json_str('{}') int(1,2)
    float(range(0,2)) extend_list(1) nothing(1) choice(choice(1,2),3) choice(range(0,2))
    1,range(0,2) int(nan) int(inf) int(1e400) range(0,100000) range(0,3,-1) sort(a,1)
    sort(1,null) sort([1],{a:1}) float(null) bool(null) str([1,2]) int([1,a]) choice(a=1)
    range(1,2,3,4) sort(1,nan) range(0.1,0.5,0.1) -1,0,1 turn,circle car,pedestrian gp_ekf,point
""")
INTERPOLATIONS = words(r"""
    ${seed} ${rig.width} ${rig} ${nope} ${} ${.width} ${..seed} ${oc.env:HOME} ${oc.env:NO_SUCH}
    ${oc.env:NO_SUCH,3} ${oc.decode:'[1'} ${now:%Y} ${hydra:run.dir} ${oc.create:{a:1}}
    ${oc.select:seed} ${oc.dict.keys:rig} ${${rig.width}} \${seed} a${seed}b ${seed}${seed}
    ${oc.deprecated:seed} ${path.${path.kind}} ??? ${seed ${oc.env:} ${oc.decode:nan}
    ${oc.decode:${seed}} ${oc.select:rig} ${oc.select:} ${a:b:c} ${rig.width[0]}
    ${path.start[0]} ${path.points[9]} ${pictures.frames}
""")
WORDS = words("""
    car left s tcp://x:1 10GB -3GB 1e9TB nanGB a/b /dev/null . ~
""")
TYPED = words("""
    [1,2] [1,2,3] [0.5,0.5] [[0,12],[3,15]] [[0,12],[0,12]] [[0,12]] [[1e300,1e300],[0,9]] [0,0]
    [-5,0] [0,1e308] [1e-320,9] [true,false] [null,null] ['1','2'] [0,0,0]
    [99999999999999999999,1] [0] [0,1,2,3,4,5,6,7,8,9] [1,1] 1e-320 5e-324 1e-12 1e6 1e9 1e12
    1e18 1e30 1.7976931348623157e308 179.9 90 -90 180 360 0.001 0.99999999 16 32 65 4096 4097
    9007199254740993 -1e-12
""")
