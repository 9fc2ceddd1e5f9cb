// SPDX-License-Identifier: GPL-3.0-or-later
// What LungBehaviour.cs needs of UnityEngine, so that it can be compiled without it.
namespace UnityEngine
{
    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
    }
    public class Mesh
    {
        public Rendering.IndexFormat indexFormat;
        public Vector3[] vertices;
        public int[] triangles;
        public void MarkDynamic() {}
        public void RecalculateNormals() {}
    }
    public class MeshFilter { public Mesh mesh; }
    public class MonoBehaviour { public T GetComponent<T>() where T : class { return null; } }
}
namespace UnityEngine.Rendering { public enum IndexFormat { UInt16, UInt32 } }
