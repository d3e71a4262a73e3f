"""An independent judge: the foot point by dense sampling and scipy, from the definition."""

import jax
import numpy as np
from scipy.optimize import minimize_scalar

SAMPLES = 4001


def sampled(contour, samples=SAMPLES):
    """Return parameters and points over the whole domain, joints included."""
    start, end = (float(edge) for edge in contour.domain)
    parameters = np.linspace(start, end, samples)
    if hasattr(contour, "breaks"):
        parameters = np.union1d(parameters, np.asarray(contour.breaks))
    return parameters, np.asarray(jax.jit(jax.vmap(contour.position))(parameters))


class Judge:
    """Distances to one contour, local and global."""

    def __init__(self, contour, samples=SAMPLES):
        self.contour = contour
        self.parameters, self.points = sampled(contour, samples)
        self.position = jax.jit(lambda p: contour.position(p))

    def _refined(self, q, candidates, squared):
        """Return the least distance around the few best samples."""
        best = np.inf
        order = candidates[np.argsort(squared[candidates])][:6]
        last = len(self.parameters) - 1
        for k in order:
            low, high = self.parameters[max(k - 1, 0)], self.parameters[min(k + 1, last)]
            best = min(best, np.sqrt(squared[k]))
            joints = [float(self.parameters[k])]
            for a, b in ((low, joints[0]), (joints[0], high)):
                if b > a:
                    found = minimize_scalar(
                        lambda p: float(np.linalg.norm(np.asarray(self.position(p)) - q)),
                        bounds=(a, b), method="bounded", options={"xatol": 1e-13},
                    )  # fmt: skip
                    best = min(best, found.fun)
        return best

    def everywhere(self, q):
        squared = np.sum((self.points - q) ** 2, axis=1)
        return self._refined(q, np.arange(len(squared)), squared)

    def near(self, q, near):
        """Return the distance to the stretch around a parameter, and whether it is clear-cut."""
        start, end = self.parameters[0], self.parameters[-1]
        at = start + np.mod(near - start, end - start) if self.contour.closed else near
        at = np.clip(at, start, end)
        centre = np.asarray(self.position(at))
        error = np.linalg.norm(centre - q)
        inside = np.linalg.norm(self.points - centre, axis=1) <= 2 * error
        k = int(np.clip(np.searchsorted(self.parameters, at), 0, len(self.parameters) - 1))
        n = len(self.parameters)
        chosen, limit = set(), n if self.contour.closed else None
        for way in (1, -1):
            j = k if way > 0 else k - 1
            for _ in range(n):
                if limit is None and not 0 <= j < n:
                    break
                if not inside[j % n]:
                    break
                chosen.add(j % n)
                j += way
        squared = np.sum((self.points - q) ** 2, axis=1)
        near_samples = np.array(sorted(chosen | {k, max(k - 1, 0)}))
        return min(self._refined(q, near_samples, squared), error)
