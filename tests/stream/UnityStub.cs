// SPDX-License-Identifier: GPL-3.0-or-later
// Stubs of the UnityEngine types that LungBehaviour.cs uses, so that it compiles without Unity.
namespace UnityEngine
{
    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
    }
    public struct Quaternion
    {
        public float x, y, z, w;
        public Quaternion(float x, float y, float z, float w) { this.x = x; this.y = y; this.z = z; this.w = w; }
        // Rotate v: v + 2 w (u x v) + 2 u x (u x v), u = (q.x, q.y, q.z), w = q.w; also in left-handed axes.
        public static Vector3 operator *(Quaternion q, Vector3 v)
        {
            Vector3 t = new Vector3(2 * (q.y * v.z - q.z * v.y), 2 * (q.z * v.x - q.x * v.z), 2 * (q.x * v.y - q.y * v.x));
            return new Vector3(v.x + q.w * t.x + q.y * t.z - q.z * t.y, v.y + q.w * t.y + q.z * t.x - q.x * t.z,
                               v.z + q.w * t.z + q.x * t.y - q.y * t.x);
        }
    }
    public class Transform { public bool hasChanged; public Quaternion rotation; }
    public class Mesh
    {
        public Rendering.IndexFormat indexFormat;
        public Vector3[] vertices, normals;
        public int[] triangles;
        public void MarkDynamic() {}
    }
    public class MeshFilter { public Mesh mesh; }
    public class MonoBehaviour
    {
        readonly MeshFilter filter = new MeshFilter();
        public Transform transform = new Transform();
        public T GetComponent<T>() where T : class { return filter as T; }
    }
}
namespace UnityEngine.Rendering { public enum IndexFormat { UInt16, UInt32 } }
