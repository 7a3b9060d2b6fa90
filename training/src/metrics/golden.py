"""Golden values for features.rs and distribution.rs, by numpy and scipy.

Run: python golden.py. Independent of the Rust code: loops over frames, as the
definitions are written.
"""
import numpy as np
from scipy import linalg

RATE = 60.0
t = np.arange(120)[:, None] / RATE
j = np.arange(22)[None, :]
p = np.stack([
    0.3 * np.sin(2 * t + j) + 0.1 * np.cos(j),
    1.0 + 0.5 * np.sin(1.7 * j) + 0.1 * np.cos(3 * t + 2 * j),
    0.2 * np.cos(4 * t + 0.5 * j) + 0.1 * np.sin(2.3 * j),
], axis=-1).astype(np.float32).astype(np.float64)


def kinetic(p, dt, published):
    out = []
    for joint in range(p.shape[1]):
        horizontal = vertical = energy = 0.0
        for i in range(1, len(p)):
            v, a = [], []
            for k in range(i - 2, i + 3):
                if 0 <= k - 1 and k < len(p):
                    v.append((p[k, joint] - p[k - 1, joint]) / dt)
                    if k + 1 < len(p):
                        after = (p[k + 1, joint] - p[k, joint]) / dt
                        if published:
                            before = p[k, joint] - p[k - 1, joint] / dt
                        else:
                            before = v[-1]
                        a.append((after - before) / dt)
            v = np.mean(v, axis=0)
            horizontal += v[0] ** 2 + v[2] ** 2
            vertical += v[1] ** 2
            energy += np.linalg.norm(np.mean(a, axis=0)) if a else 0.0
        out += [x / (len(p) - 1) for x in (horizontal, vertical, energy)]
    return np.array(out)


NAMES = ("root lhip rhip belly lknee rknee spine lankle rankle chest ltoes rtoes neck "
         "lin rin head lsho rsho lelb relb lwri rwri").split()


def geometric(p):
    hl, sw, hw = 0.2568, 0.3908, 0.1192
    rows = []
    for i in range(1, len(p)):
        now = dict(zip(NAMES, p[i]))
        old = dict(zip(NAMES, p[i - 1]))
        low = p[i][:, 1].min()

        def unit(v):
            return v / np.linalg.norm(v)

        def move(a, b, c, limit):
            v = ((now[c] - now[a]) - (old[c] - old[a])) * 120
            return v @ unit(now[b] - now[a]) > limit

        def nmove(a, b, c, d, limit):
            v = ((now[d] - now[a]) - (old[d] - old[a])) * 120
            return v @ unit(np.cross(now[c] - now[a], now[b] - now[a])) > limit

        def plane(a, b, c, d, limit):
            return (now[d] - now[a]) @ unit(np.cross(now[c] - now[a], now[b] - now[a])) > limit

        def nplane(a, b, c, d, limit):
            return (now[d] - now[c]) @ unit(now[b] - now[a]) > limit

        def angle(a, b, c, d, low, high):
            x = np.degrees(np.arccos(unit(now[b] - now[a]) @ unit(now[d] - now[c])))
            return low < x < high

        def fast(a, limit):
            return np.linalg.norm(now[a] - old[a]) * 120 > limit

        tilt = np.degrees(np.arccos(unit(now["root"] - now["neck"])[1]))
        rows.append([
            nmove("neck", "rhip", "lhip", "rwri", 1.8 * hl), nmove("neck", "lhip", "rhip", "lwri", 1.8 * hl),
            nplane("chest", "neck", "neck", "rwri", .2 * hl), nplane("chest", "neck", "neck", "lwri", .2 * hl),
            move("belly", "chest", "chest", 1.8 * hl), move("belly", "chest", "chest", 1.8 * hl),
            angle("relb", "rsho", "relb", "rwri", 0, 110), angle("lelb", "lsho", "lelb", "lwri", 0, 110),
            nplane("lsho", "rsho", "lwri", "rwri", 2.5 * sw), move("lwri", "rwri", "rwri", 1.4 * hl),
            move("rwri", "root", "lwri", 1.4 * hl), move("lwri", "root", "rwri", 1.4 * hl),
            fast("rwri", 2.5 * hl), fast("lwri", 2.5 * hl),
            plane("root", "lhip", "ltoes", "rankle", .38 * hl), plane("root", "rhip", "rtoes", "lankle", .38 * hl),
            now["rankle"][1] - low > 1.2 * hl, now["lankle"][1] - low > 1.2 * hl,
            nplane("lhip", "rhip", "lankle", "rankle", 2.1 * hw),
            angle("rknee", "rhip", "rknee", "rankle", 0, 110), angle("lknee", "lhip", "lknee", "lankle", 0, 110),
            fast("rankle", 2.5 * hl), fast("lankle", 2.5 * hl),
            angle("neck", "root", "rsho", "relb", 25, 180), angle("neck", "root", "lsho", "lelb", 25, 180),
            angle("neck", "root", "rhip", "rknee", 50, 180), angle("neck", "root", "lhip", "lknee", 50, 180),
            plane("rankle", "neck", "lankle", "root", .5 * hl), 70 < tilt < 110,
            low - now["rwri"][1] > -1.2 * hl, low - now["lwri"][1] > -1.2 * hl, fast("root", 2.3 * hl),
        ])
    return np.array(rows, float).mean(0)


c, b = kinetic(p, 1 / RATE, False), kinetic(p, 1 / RATE, True)
print("GOLDEN_KINETIC", [float(x) for x in (c[0], c[1], c[2], c.sum(), b[2], b.sum())])
print("GOLDEN_GEOMETRIC", [round(float(x), 5) for x in geometric(p)])

n = np.arange(30)[:, None]
k = np.arange(5)[None, :]
real = np.sin(1.3 * n + 2.1 * k) * (1 + k) + 0.5 * k
made = np.cos(0.7 * n + 1.9 * k) * (1.5 + 0.5 * k) + 0.3 * np.sin(n * (k + 1))
mean, std = real.mean(0), real.std(0)
x, y = (real - mean) / std, (made - mean) / std
cx, cy = np.cov(x, rowvar=False), np.cov(y, rowvar=False)
root = linalg.sqrtm(cx @ cy).real
fid = ((x.mean(0) - y.mean(0)) ** 2).sum() + np.trace(cx + cy - 2 * root)
pairs = [np.linalg.norm(a - b) for i, a in enumerate(y) for b in y[:i]]
print("GOLDEN_FID", fid, "GOLDEN_DISTANCE", np.mean(pairs))
